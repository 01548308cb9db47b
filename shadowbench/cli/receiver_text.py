"""What ``shadowbench view --pixel`` prints: a receiver's report as text and tables."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from shadowbench.cli.console import plain, put

if TYPE_CHECKING:
    from rich.console import RenderableType

MOST_ROWS = 64
"""Lines of a table that are printed; --json has all."""

_FAILURE = ("FALSE",)


def show(said: dict[str, Any]) -> None:
    """Print what is known of a pixel."""
    x, y = said["pixel"]
    put(plain(f"{said['method']}\n{said['view']}\ncase {said['case_key']} of run {said['run_id']}", style="bold"))
    receiver = said["receiver"]
    if receiver is None:
        put(plain(f"pixel {x},{y} sees nothing (sky); the nearest pixel with a receiver is {_pair(said['nearest'])}"))
        return
    others = f", receiver {receiver['sample']} of {receiver['samples']} (--sample)" if receiver["samples"] > 1 else ""
    put(plain(f"\npixel {x},{y}{others}", style="bold"))
    put(_pairs(_facts(receiver)))
    for reason in receiver["reasons"]:
        put(plain(f"=> {reason}", style="bold red" if reason.startswith(_FAILURE) else ""))
    account = receiver["account"]
    if account is None:
        put(plain("\nthe technique tells no account of this receiver"))
        return
    for step in account["steps"]:
        put(plain(f"\n{step['title']}", style="bold"))
        if step["quantities"]:
            put(_pairs([(q["name"], f"{_text(q['value'])} {q['unit']}".rstrip()) for q in step["quantities"]]))
        if step["table"] is not None:
            put(_table(step["table"]))
        for line in step["formula"]:
            put(plain(f"  {line}"))
    put(plain(f"\nvisibility {_text(account['visibility'])}", style="bold"))


def _facts(receiver: dict[str, Any]) -> list[tuple[str, str]]:
    facts = [
        ("position", _text(receiver["position"])),
        ("normal", f"{_text(receiver['normal'])}, cosine to the light {receiver['cosine']:.4g}"),
        ("surface", _surface(receiver["surface"])),
    ]
    if any(receiver["world_origin"]):
        facts.insert(1, ("world's origin", _text(receiver["world_origin"])))
    if receiver["light_space"] is not None:
        facts.append(("in light space", _place(receiver["light_space"])))
    truth = _text(receiver["truth"])
    truth += ", turned away from the light" if receiver["is_turned_away"] else ""
    truth += "" if receiver["is_in_field"] else ", outside the light's field"
    facts.append(("truth", truth))
    blocker = receiver["blocker"]
    if blocker is not None and not receiver["is_turned_away"]:
        facts.append(("true blocker", f"{_surface(blocker['surface'])}, {blocker['distance']:.6g} scene units away"))
        if blocker["light_space"] is not None:
            facts.append(("its light space", _place(blocker["light_space"])))
    if receiver["filtered_truth"] is not None:
        facts.append(("filtered truth", _text(receiver["filtered_truth"])))
    facts.append(("method", _text(receiver["visibility"])))
    if receiver["classes"]:
        facts.append(("masks", ", ".join(name.replace("_", " ") for name in receiver["classes"])))
    return facts


def _surface(surface: dict[str, Any]) -> str:
    return f"triangle {surface['triangle']} of instance {surface['instance']} ('{surface['mesh']}')"


def _place(place: dict[str, Any]) -> str:
    face = f"face {place['face']}, " if place["face"] else ""
    return f"{face}u {place['u']:.6g}, v {place['v']:.6g}, depth {place['depth']:.8g}"


def _pair(values: list[int]) -> str:
    return ",".join(map(str, values))


def _pairs(facts: list[tuple[str, str]]) -> RenderableType:
    from rich.table import Table

    grid = Table.grid(padding=(0, 2))
    grid.add_column()
    grid.add_column(overflow="fold")
    for name, value in facts:
        grid.add_row(plain(f"  {name}"), plain(value))
    return grid


def _table(table: dict[str, Any]) -> RenderableType:
    from rich import box
    from rich.table import Table

    drawn = Table(box=box.SIMPLE_HEAD, show_edge=False, pad_edge=False)
    for column in table["columns"]:
        drawn.add_column(plain(column), justify="right")
    for row in table["rows"][:MOST_ROWS]:
        drawn.add_row(*(plain(_text(value)) for value in row))
    if len(table["rows"]) > MOST_ROWS:
        drawn.caption = f"{len(table['rows']) - MOST_ROWS} more with --json"
    return drawn


def _text(value: Any) -> str:
    """Return a JSON value as text: numbers with as many digits as float32 has."""
    if isinstance(value, list):
        return ", ".join(_text(inner) for inner in value)
    if isinstance(value, bool):
        return "yes" if value else "no"
    if value is None:
        return "-"
    return f"{value:.8g}" if isinstance(value, float) else str(value)
