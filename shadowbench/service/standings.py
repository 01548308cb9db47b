"""An experiment's leaderboard: quality side by side across machines and versions, time within one machine.

One view at a time: figures of different scenes, lights or sizes are not to be averaged. Quality is the same on every
machine, so the versions stand beside each other and a technique whose pixels differ between machines is marked. Times
are those of one machine, the reader's choice.
"""

from __future__ import annotations

from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any, cast

from shadowbench.rows import ResultRow
from shadowbench.service.problems import Problem
from shadowbench.service.responding import Answer
from shadowbench.store.catalogue import Catalogue, View
from shadowbench.store.derived import LIKENESSES, MEASURES, QUALITY_COLUMNS, TIME_COLUMNS, TIMES
from shadowbench.tables.labels import Labels

MOST_VERSIONS = 4
LINES_A_PAGE = 100
MOST_LINES = 10_000
_QUALITY = (*QUALITY_COLUMNS, "machines", "differs")
SORTS = (*MEASURES, *LIKENESSES, *TIMES, "bytes_kept", "technique")
_TOLD_APART = ("moving", "threads", "device")
LARGER_IS_BETTER = frozenset({"ssim"})


def leaderboard(
    catalogue: Catalogue,
    experiment: str,
    *,
    view: str = "",
    machine: str = "",
    versions: Sequence[str] = (),
    sort: str = "failure_percent",
    limit: int | None = None,
) -> Answer:
    """Return the leaderboard of an experiment.

    Args:
        catalogue: Where from.
        experiment: Its name.
        view: The key of a view; the one of most techniques if empty.
        machine: Whose times; those of the one that was measured on last if empty.
        versions: Which versions; the newest four if empty.
        sort: By what, the first version that has it counting.
        limit: How many techniques, the first ones in this order; all by default.

    Raises:
        Problem: There is no such experiment, view or column.
    """
    if sort not in SORTS:
        raise Problem(422, f"query.sort: there is no such column; known are {', '.join(SORTS)}", place="query.sort")
    views = catalogue.views(experiment)
    if not views:
        raise Problem(404, "no run has a row of an experiment of this name")
    if view:
        chosen = next((one for one in views if one.view_key == view), None)
    else:
        counts = catalogue.technique_counts(experiment)
        chosen = max(views, key=lambda one: counts[one.view_key])
    if chosen is None:
        raise Problem(404, "the experiment has no such view")
    places = catalogue.places(experiment, chosen.view_key)
    newest_first = sorted(places, key=lambda place: place[2], reverse=True)
    machines = list(dict.fromkeys(place[0] for place in newest_first))
    every = list(dict.fromkeys(place[1] for place in newest_first))
    shown = [version for version in every if version in versions] if versions else every[:MOST_VERSIONS]
    chosen_machine = machine if machine in machines else machines[0]
    quality = catalogue.quality_standings(experiment, chosen.view_key, shown)
    times = catalogue.time_standings(experiment, chosen.view_key, chosen_machine, shown)
    lines = _lines(catalogue.techniques(experiment, chosen.view_key), quality, times)
    lines.sort(key=lambda line: _place(line, sort, shown))
    document = {
        "experiment": experiment,
        "view": _view(chosen),
        "views": [_view(one) for one in views],
        "machine": chosen_machine,
        "machines": machines,
        "versions": shown,
        "all_versions": every,
        "sort": sort,
        "line_count": len(lines),
        "lines": lines[:limit],
    }
    header = ("technique", "version", "outcome", *MEASURES, *LIKENESSES, "machines", "differs", "machine")
    table = _csv_lines(lines[:limit], shown, chosen_machine)
    return Answer("leaderboard.html", document, (*header, *_TIME_FIELDS), table, {"most_lines": MOST_LINES})


_TIME_FIELDS = (
    *(f"{time}{end}" for time in TIMES for end in ("", "_low", "_high")),
    "bytes_kept",
    "run_id",
    "case_key",
)


def view_title(fields: dict[str, Any]) -> str:
    """Return a view in a few words."""
    parameters = ", ".join(f"{name}={value}" for name, value in fields["scene_parameters"].items())
    scene = f"{fields['scene']}({parameters})" if parameters else fields["scene"]
    samples = f", {fields['pixel_samples']} samples a pixel" if fields["pixel_samples"] > 1 else ""
    layers = f", {fields['layers']} layers" if fields["layers"] > 1 else ""
    size = f"{fields['width']}x{fields['height']}"
    return f"{scene}, light {fields['light']}, camera {fields['camera']}, {size}{samples}{layers}"


def labels(techniques: dict[str, dict[str, Any]]) -> dict[str, str]:
    """Return each technique's label: the method, and what tells it apart from the others."""
    lines = {
        key: SimpleNamespace(method=fields["method"], method_parameters=fields["method_parameters"])
        for key, fields in techniques.items()
    }
    made = Labels("method", cast("list[ResultRow]", list(lines.values())))
    found = {key: made.of(cast("ResultRow", line)) for key, line in lines.items()}
    several = {name for name in _TOLD_APART if len({str(t[name]) for t in techniques.values()}) > 1}
    for key, fields in techniques.items():
        found[key] += "".join(f", {name}: {fields[name]}" for name in _TOLD_APART if name in several)
    return found


def _view(view: View) -> dict[str, Any]:
    return {"key": view.view_key, "title": view_title(view.fields)} | view.fields


def _lines(techniques: dict[str, dict[str, Any]], quality: Sequence[Any], times: Sequence[Any]) -> list[dict[str, Any]]:
    named = labels(techniques)
    lines: dict[str, dict[str, Any]] = {}
    for row in quality:
        key = row.technique_key
        if key not in lines:
            lines[key] = {"technique": techniques[key] | {"key": key, "label": named[key]}, "quality": {}, "time": {}}
        lines[key]["quality"][row.code_version] = dict(zip(_QUALITY, row, strict=True))
    for row in times:
        lines[row.technique_key]["time"][row.code_version] = dict(zip(TIME_COLUMNS, row, strict=True))
    return list(lines.values())


def _place(line: dict[str, Any], sort: str, versions: Sequence[str]) -> tuple[bool, Any, str]:
    label = line["technique"]["label"]
    if sort == "technique":
        return (False, label, label)
    part = line["time"] if sort in TIMES or sort == "bytes_kept" else line["quality"]
    value = next((part[v][sort] for v in versions if v in part and part[v][sort] is not None), None)
    return (value is None, -value if value is not None and sort in LARGER_IS_BETTER else value or 0.0, label)


def _csv_lines(lines: Sequence[dict[str, Any]], versions: Sequence[str], machine: str) -> list[list[Any]]:
    found = []
    for line in lines:
        for version in versions:
            quality, time = line["quality"].get(version), line["time"].get(version, {})
            if quality is None:
                continue
            said = [quality[name] for name in ("outcome", *MEASURES, *LIKENESSES, "machines", "differs")]
            times = [time.get(name) for name in _TIME_FIELDS[:-2]]
            where = [quality["run_id"], quality["case_key"]]
            found.append([line["technique"]["label"], version, *said, machine, *times, *where])
    return found
