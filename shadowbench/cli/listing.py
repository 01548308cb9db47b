"""``shadowbench list`` and ``shadowbench show``: what there is, and all there is to know about one of it.

A plugin that cannot be loaded is listed with its error. ``show`` prints what the plugin's own declarations say:
nothing here knows any method or scene.
"""

from __future__ import annotations

import importlib
import inspect
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from shadowbench.cli import completion
from shadowbench.cli.console import plain, put
from shadowbench.cli.options import DEFAULT_RESULTS, PluginOption, ResultsOption, open_store
from shadowbench.errors import PluginError, ShadowbenchError, UsageError, did_you_mean

if TYPE_CHECKING:
    from shadowbench.experiment import Experiment
    from shadowbench.plugins import Entry, Kind, Registry


WHAT = ("methods", "scenes", "experiments", "runs")

TOPICS = {"experiment-file": "shadowbench.experiment", "claims": "shadowbench.claim"}
"""What ``show`` explains besides: the modules whose documentation says how a file is written."""


def list_names(
    what: Annotated[
        str | None,
        typer.Argument(
            metavar="[methods|scenes|experiments|runs]",
            help="What to list; methods, scenes and experiments if nothing is said.",
            autocompletion=completion.what_to_list,
            show_default=False,
        ),
    ] = None,
    plugin: PluginOption = None,
    results: ResultsOption = DEFAULT_RESULTS,
) -> None:
    """List methods, scenes, experiments or runs."""
    from shadowbench.plugins import Registry

    if what is not None and what not in WHAT:
        raise UsageError(f"there is no list of '{what}'; {did_you_mean(what, WHAT)}")
    wanted = WHAT[:3] if what is None else (what,)
    registry = Registry(tuple(plugin or ()))
    for one in wanted:
        columns, lines = _listed(one, registry, results)
        _print_list(one if what is None else "", columns, lines)


def _listed(what: str, registry: Registry, results: Path) -> tuple[tuple[str, ...], Iterator[tuple[str, ...]]]:
    if what == "methods":
        return ("name", "title", "source", "from", "state"), _plugin_lines(registry, "method")
    if what == "scenes":
        return ("name", "title", "source", "from", "state"), _plugin_lines(registry, "scene")
    if what == "experiments":
        return ("name", "title", "source"), _experiment_lines()
    return ("run", "begun", "experiments", "status", "cases", "outcomes"), _run_lines(results)


def _plugin_lines(registry: Registry, kind: Kind) -> Iterator[tuple[str, ...]]:
    for entry in registry.entries(kind):
        try:
            cls = entry.load()
            reason = _availability(cls)
        except PluginError as error:
            yield entry.name, "", "", entry.origin, f"broken: {error}"
            continue
        yield entry.name, cls.title, cls.source, entry.origin, f"not here: {reason}" if reason else "ready"


def _availability(cls: type[Any]) -> str | None:
    """Return why a method cannot run here, or ``None``; a plugin's own test may fail as well."""
    if not hasattr(cls, "available"):
        return None
    try:
        reason: str | None = cls.available()
    except Exception as error:  # noqa: BLE001 - a plugin may raise anything
        return f"its availability test fails: {type(error).__name__}: {error}"
    return reason


def _experiment_lines() -> Iterator[tuple[str, ...]]:
    from shadowbench.experiment import builtin_names, load
    from shadowbench.experiment_groups import groups, title_of

    for name in builtin_names():
        experiment = load(name)
        yield name, experiment.title, experiment.source
    for name, members in groups().items():
        yield name, f"{title_of(name)} ({len(members)})", ""


def _run_lines(results: Path) -> Iterator[tuple[str, ...]]:
    with open_store(results) as store:
        for run in store.runs():
            counts = store.outcome_counts(run.run_id)
            outcomes = ", ".join(f"{count} {outcome}" for outcome, count in counts.items())
            cases = f"{sum(counts.values())} of {run.case_count}"
            yield run.run_id, run.created_at, ", ".join(run.experiments), run.status, cases, outcomes


def _print_list(heading: str, columns: tuple[str, ...], lines: Iterator[tuple[str, ...]]) -> None:
    from rich.table import Table

    listed = Table(title=heading or None, title_justify="left", box=None, pad_edge=False, header_style="bold")
    for column in columns:
        listed.add_column(column, overflow="fold", no_wrap=column in ("name", "run"))
    for line in lines:
        listed.add_row(*(plain(cell, _style(cell)) for cell in line))
    put(listed)
    if heading:
        print()


def _style(cell: str) -> str:
    return "red" if cell.startswith("broken: ") else "yellow" if cell.startswith("not here: ") else ""


def show(
    name: Annotated[
        str,
        typer.Argument(
            metavar="NAME",
            help="A method, a scene, an experiment or a group of them.",
            autocompletion=completion.anything,
        ),
    ],
    plugin: PluginOption = None,
) -> None:
    """Explain a method, a scene, an experiment or a group; experiment-file and claims say how to write your own."""
    from shadowbench import experiment
    from shadowbench.experiment_groups import groups
    from shadowbench.plugins import Registry

    registry = Registry(tuple(plugin or ()))
    kinds: tuple[Kind, ...] = ("method", "scene")
    found = [entry for kind in kinds for entry in registry.entries(kind) if entry.name == name]
    for entry in found:
        _show_plugin(entry)
    if name in experiment.builtin_names() or name.endswith(".toml"):
        _show_experiment(experiment.load(name))
    elif name in groups():
        _show_group(name, groups()[name])
    elif name in TOPICS:
        _paragraphs(inspect.getdoc(importlib.import_module(TOPICS[name])) or "")
    elif not found:
        known = [*registry.names("method"), *registry.names("scene"), *experiment.builtin_names(), *groups(), *TOPICS]
        raise UsageError(f"no method, scene or experiment is called '{name}'; {did_you_mean(name, known)}")


def _show_plugin(entry: Entry) -> None:
    from shadowbench.parameters import describe_parameters

    try:
        cls = entry.load()
    except PluginError as error:
        raise ShadowbenchError(f"{entry.kind} '{entry.name}' is broken: {error}") from error
    _heading(entry.kind, cls.name, cls.title)
    facts = [("source", cls.source), ("from", entry.origin)]
    if entry.kind == "method":
        reason = _availability(cls)
        facts += [
            ("self-hit rule", _self_hit(cls)),
            ("devices", ", ".join(sorted(cls.devices))),
            ("repeats", "the same bits every time" if cls.deterministic else "may differ; differences are counted"),
            ("build", "belongs to every frame" if _is_view_dependent(cls) else "when the light or a caster moves"),
            ("here", f"not available: {reason}" if reason else "available"),
        ]
    _facts(facts)
    _paragraphs(inspect.getdoc(sys.modules[cls.__module__]) or inspect.getdoc(cls) or "")
    columns = ("name", "default", "unit", "range", "help")
    described = [d | {"unit": d["unit"].removeprefix("1")} for d in describe_parameters(cls.Parameters)]
    _rows("Parameters", columns, [tuple(d[column] for column in columns) for d in described])
    if entry.kind == "method":
        _rows("Counters", ("name", "what it counts"), list(cls.counters.items()))


def _self_hit(cls: type[Any]) -> str:
    """Return the rule of a ray tracer, with the default parameters where it depends on them."""
    method = _with_defaults(cls)
    rule: str = cls.self_hit if method is None else method.self_hit_rule()
    return rule


def _is_view_dependent(cls: type[Any]) -> bool:
    method = _with_defaults(cls)
    return bool(cls.view_dependent if method is None else method.is_view_dependent())


def _with_defaults(cls: type[Any]) -> Any:
    """Return a method with the default parameters, or ``None`` if it cannot be made with them."""
    from shadowbench.method import Context

    try:
        return cls(cls.Parameters(), Context())
    except Exception:  # noqa: BLE001 - a required parameter, or a plugin that needs more than that
        return None


def _show_experiment(experiment: Experiment) -> None:
    from shadowbench.claim import in_words

    _heading("experiment", experiment.name, experiment.title)
    _facts([("source", experiment.source)])
    _paragraphs(experiment.description)
    lines = [
        (
            ", ".join(map(str, c.scenes)),
            ", ".join(map(str, c.methods)) or "all",
            ", ".join(name or "first" for name in c.lights),
            ", ".join(name or "first" for name in c.cameras),
            ", ".join(f"{width}x{height}" for width, height in c.sizes),
            ", ".join(map(str, c.pixel_samples)),
            ", ".join(map(str, c.layers)),
            ", ".join(c.moving),
            ", ".join(map(str, c.threads)) or "as the run",
        )
        for c in experiment.comparisons
    ]
    _rows(
        "Comparisons",
        ("scenes", "methods", "lights", "cameras", "sizes", "pixel samples", "layers", "moving", "threads"),
        lines,
    )
    titles = [(layout.title, ", ".join(layout.values)) for layout in experiment.tables]
    _rows("Tables", ("title", "columns"), titles)
    claims = [
        (claim.name, claim.statement, claim.source or experiment.source, "\n".join(map(in_words, claim.tests)))
        for claim in experiment.claims
    ]
    _rows("Claims", ("name", "what is claimed", "source", "holds if"), claims)


def _show_group(name: str, members: Sequence[str]) -> None:
    from shadowbench.experiment import load
    from shadowbench.experiment_groups import title_of

    _heading("group", name, title_of(name))
    lines = [(member, read.title, str(len(read.claims))) for member in members for read in [load(member)]]
    _rows("Experiments", ("name", "title", "claims"), lines)


def _heading(kind: str, name: str, title: str) -> None:
    put(plain(name, "bold") + plain(f" ({kind}) {title}\n"))


def _facts(facts: list[tuple[str, str]]) -> None:
    from rich.table import Table

    grid = Table.grid(padding=(0, 2))
    for name, value in facts:
        if value:
            grid.add_row(plain(name, "dim"), plain(value))
    put(grid)
    print()


def _paragraphs(text: str) -> None:
    if text.strip():
        put(plain(f"{text.strip()}\n"))


def _rows(heading: str, columns: tuple[str, ...], lines: Sequence[tuple[str, ...]]) -> None:
    from rich.table import Table

    if not lines:
        return
    listed = Table(title=heading, title_justify="left", title_style="bold", box=None, pad_edge=False)
    for column in columns:
        listed.add_column(column, overflow="fold")
    for line in lines:
        listed.add_row(*(plain(cell) for cell in line))
    put(listed)
    print()
