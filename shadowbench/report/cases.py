"""What the page says about each case: rows put together by view, and one card of facts a case.

A *view* is a scene with its parameters, a light, a camera and a picture size: all its cases share one reference
picture and may be compared. Cases stand in it in the order they were measured, whatever their outcome.
"""

from __future__ import annotations

import json
import shlex
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from shadowbench.choices import EVERYTHING
from shadowbench.experiment import Choice
from shadowbench.report import wording
from shadowbench.report.embedding import Embedded, Embedder
from shadowbench.rows import Outcome, ResultRow, RunRecord, own_libraries
from shadowbench.tables.columns import header_text
from shadowbench.tables.labels import Labels

Facts = list[tuple[str, str]]
"""(name, value) pairs, as text."""

FIGURES = ("failure", "false_lit", "false_shadow", "acne", "peter_panning", "edge_band", "interior", "classified")
"""Measures with a percentage and a count, in the order of the card."""

TIMES = {
    "camera": "camera pass",
    "build": "build",
    "shade": "shade",
    "static_frame": "static frame",
    "dynamic_frame": "dynamic frame",
}

_OWN_PICTURE = "picture-"
"""How the names of pictures begin that a method itself drew."""

_FILTER_PICTURES = {
    "filtered-reference": "reference, filtered with the method's kernel",
    "error": "error against the filtered reference: blue is too dark, orange too lit",
}
"""Pictures of filtering methods, and what is said below them."""

_LIKENESS = (
    *("rmse", "edge_band_rmse", "interior_rmse", "ssim", "flip", "leak_mean", "leak_p99"),
    *("approximation_rmse", "discretisation_rmse", "reference_error"),
)

Key = tuple[str, str, str, str, int, int, int, int]


@dataclass(frozen=True)
class Stage:
    """One stage's median duration and its share of build + shade [%]."""

    name: str
    duration: str
    share: float


@dataclass(frozen=True)
class Card:
    """One case, ready to be written out.

    Attributes:
        anchor: Its id in the page.
        title: The method with those parameters in which it differs from its neighbours.
        row: What was measured.
        result, failures: Pictures, where there are any.
        further_pictures: (name, picture) of the filtered reference, and of those that the method itself drew.
        headline: The few figures that are always shown.
        times: (name, median, 95 % interval).
        stages: With what they leave unexplained as the last one.
        measures: (name, percentage, count).
    """

    anchor: str
    title: str
    row: ResultRow
    result: Embedded | None
    failures: Embedded | None
    further_pictures: list[tuple[str, Embedded]]
    headline: Facts
    parameters: Facts
    times: list[tuple[str, str, str]]
    stages: list[Stage]
    measures: list[tuple[str, str, str]]
    counters: Facts
    kept: Facts
    origin: Facts
    command: str

    @property
    def outcome(self) -> Outcome:
        return self.row.outcome


@dataclass(frozen=True)
class SceneView:
    """The cases of one view, beside one reference picture."""

    anchor: str
    title: str
    facts: Facts
    reference: Embedded | None
    cards: list[Card]


def view_key(row: ResultRow) -> Key:
    """Return what two rows must share to be compared with one reference."""
    parameters = json.dumps(row.scene_parameters, sort_keys=True, default=str)
    picture = (row.width, row.height, row.pixel_samples, row.layers)
    return (row.scene, parameters, row.light, row.camera, *picture)


def by_view(rows: Iterable[ResultRow]) -> list[list[ResultRow]]:
    """Return the rows of each view, in the order in which the views first appear."""
    groups: dict[Key, list[ResultRow]] = {}
    for row in rows:
        groups.setdefault(view_key(row), []).append(row)
    return list(groups.values())


def scene_views(run: RunRecord, rows: Sequence[ResultRow], embedder: Embedder) -> list[SceneView]:
    """Return the gallery: every row as a card, in its view."""
    labels = Labels("scene", rows)
    views = []
    for number, group in enumerate(by_view(rows), 1):
        first = group[0]
        names = [r.artifacts["reference"] for r in group if "reference" in r.artifacts]
        views.append(
            SceneView(
                anchor=f"view-{number}",
                title=f"{labels.of(first)}, light {first.light}, camera {first.camera}",
                facts=_scene_facts(group),
                reference=embedder.picture(names[0]) if names else None,
                cards=_cards(run, group, f"view-{number}", embedder),
            )
        )
    return views


def picture_count(rows: Sequence[ResultRow]) -> int:
    """Return how many different pictures :func:`scene_views` will ask for."""
    names = {file for r in rows for name, file in r.artifacts.items() if _is_shown(name)}
    references = [[r.artifacts["reference"] for r in g if "reference" in r.artifacts][:1] for g in by_view(rows)]
    return len(names.union(*references))


def _is_shown(artifact: str) -> bool:
    return artifact in ("result", "failures") or artifact in _FILTER_PICTURES or artifact.startswith(_OWN_PICTURE)


def _further_pictures(row: ResultRow, embedder: Embedder) -> list[tuple[str, Embedded]]:
    found = []
    for name, file in row.artifacts.items():
        is_further = name in _FILTER_PICTURES or name.startswith(_OWN_PICTURE)
        image = embedder.picture(file) if is_further else None
        if image is not None:
            found.append((_FILTER_PICTURES.get(name, name.removeprefix(_OWN_PICTURE)), image))
    return found


def titles(rows: Sequence[ResultRow], run: RunRecord) -> list[str]:
    """Return each row's method label; of rows that share one, also what moves, the threads, device or experiment."""
    labels = Labels("method", rows, defaults=run.method_defaults)
    found = [labels.of(row) for row in rows]
    for field, text in (
        ("moving", "moving: {}"),
        ("threads", "threads: {}"),
        ("device", "on {}"),
        ("experiment", "in {}"),
    ):
        if len(set(found)) < len(found) and len({getattr(row, field) for row in rows}) > 1:
            found = [
                f"{label}, {text.format(getattr(row, field))}" if found.count(label) > 1 else label
                for label, row in zip(found, rows, strict=True)
            ]
    return found


def _scene_facts(group: Sequence[ResultRow]) -> Facts:
    first = group[0]
    measured = next((r for r in group if r.receivers is not None), first)
    facts = [(key, str(value)) for key, value in first.scene_parameters.items()]
    facts.append(("picture", f"{first.width} \u00d7 {first.height} pixels"))
    if first.pixel_samples > 1:
        facts.append(("samples of every pixel", str(first.pixel_samples)))
    if first.layers > 1:
        facts.append(("layers", f"up to {first.layers}"))
    if measured.triangles is not None:
        facts.insert(0, ("triangles in all", wording.count(measured.triangles)))
    if measured.receivers is not None:
        facts.append(("receivers", wording.count(measured.receivers)))
        facts.append(("scored", wording.count(measured.scored)))
    return facts


def _cards(run: RunRecord, group: Sequence[ResultRow], view: str, embedder: Embedder) -> list[Card]:
    cards = []
    for number, (row, title) in enumerate(zip(group, titles(group, run), strict=True), 1):
        result, failures = row.artifacts.get("result"), row.artifacts.get("failures")
        cards.append(
            Card(
                anchor=f"{view}-case-{number}",
                title=title,
                row=row,
                result=embedder.picture(result) if result else None,
                failures=embedder.mask(failures) if failures else None,
                further_pictures=_further_pictures(row, embedder),
                headline=_headline(row),
                parameters=[(k, str(v)) for k, v in row.method_parameters.items()],
                times=_times(row),
                stages=_stages(row),
                measures=_measures(row),
                counters=[(k, wording.count(v)) for k, v in row.counters.items()],
                kept=[(k, wording.byte_size(v)) for k, v in row.kept.items()],
                origin=_origin(run, row),
                command=reproduce_command(row),
            )
        )
    return cards


def _headline(row: ResultRow) -> Facts:
    facts = [
        ("failure", wording.percent(row.failure_percent)),
        ("false lit", wording.percent(row.false_lit_percent)),
        ("false shadow", wording.percent(row.false_shadow_percent)),
        ("RMSE", wording.number(row.rmse)),
        ("build", wording.milliseconds(row.build_ms)),
        ("shade", wording.milliseconds(row.shade_ms)),
        ("kept", wording.byte_size(row.bytes_kept)),
    ]
    return [fact for fact in facts if fact[1] != wording.ABSENT]


def _times(row: ResultRow) -> list[tuple[str, str, str]]:
    found = []
    for field, name in TIMES.items():
        median = getattr(row, f"{field}_ms")
        if median is not None:
            span = wording.interval(getattr(row, f"{field}_ms_low"), getattr(row, f"{field}_ms_high"))
            found.append((name, wording.milliseconds(median), span))
    if row.compile_ms is not None:
        found.append(("kernel compilation (not in any other time)", wording.milliseconds(row.compile_ms), ""))
    return found


def _stages(row: ResultRow) -> list[Stage]:
    """Stage medians and, as the last entry, what they leave of build + shade (medians need not add up exactly)."""
    total = (row.build_ms or 0.0) + (row.shade_ms or 0.0)
    durations = dict(row.stages)
    if not durations or total <= 0.0:
        return [Stage(name, wording.milliseconds(d), 0.0) for name, d in durations.items()]
    durations["not in any stage"] = max(0.0, total - sum(durations.values()))
    return [Stage(n, wording.milliseconds(d), round(min(100.0, 100.0 * d / total), 1)) for n, d in durations.items()]


def _measures(row: ResultRow) -> list[tuple[str, str, str]]:
    found = []
    for field in (*FIGURES, "turned_away"):
        value = getattr(row, f"{field}_percent")
        if value is not None:
            count = wording.count(getattr(row, f"{field}_count"))
            found.append((field.replace("_", " "), wording.percent(value), count))
    for field in _LIKENESS:
        value = getattr(row, field)
        if value is not None:
            found.append((header_text(field), wording.number(value), ""))
    return found


def _origin(run: RunRecord, row: ResultRow) -> Facts:
    facts = [
        ("experiment", row.experiment),
        ("self-hit rule", row.self_hit),
        ("device", f"{row.device}, threads: {row.threads}"),
        ("rounds", "" if row.rounds is None else str(row.rounds)),
        ("largest resident size", "" if row.peak_rss_bytes is None else wording.byte_size(row.peak_rss_bytes)),
        ("measured", wording.moment(row.measured_at) if row.measured_at else ""),
        *own_libraries(run, [row]).items(),
        ("code", row.code_version),
        ("case", row.case_key),
    ]
    return [fact for fact in facts if fact[1]]


def reproduce_command(row: ResultRow) -> str:
    """Return the command line that measures this case again."""
    words = ["shadowbench", "run", "--scene", _choice(row.scene, row.scene_parameters)]
    words += ["--method", _choice(row.method, row.method_parameters)]
    words += ["--light", row.light, "--camera", row.camera, "--size", f"{row.width}x{row.height}"]
    if row.pixel_samples > 1:
        words += ["--pixel-samples", str(row.pixel_samples)]
    if row.layers > 1:
        words += ["--layers", str(row.layers)]
    if row.moving != EVERYTHING:
        words += ["--moving", row.moving]
    words += ["--device", row.device, "--threads", str(row.threads)]
    return shlex.join(wording.shown(word) for word in words)


def _choice(name: str, parameters: dict[str, Any]) -> str:
    return str(Choice(name, {key: (_argument(value),) for key, value in parameters.items() if value is not None}))


def _argument(value: Any) -> Any:
    return repr(value) if isinstance(value, float) else value
