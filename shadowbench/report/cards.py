"""What the page says about each case: a tile of figures in the gallery, and everything else when it is opened.

Everything is text here already. What opens with a case travels as JSON beside the page's markup
(:meth:`Card.as_json`), so that a page of hundreds of cases stays quick to load; the script writes it as text, never as
markup.
"""

from __future__ import annotations

import shlex
from dataclasses import dataclass
from typing import Any

from shadowbench.choices import EVERYTHING
from shadowbench.experiment import Choice
from shadowbench.report import wording
from shadowbench.report.embedding import PicturePool, Priority
from shadowbench.report.masks import CLASSIFIED, KINDS
from shadowbench.rows import RATIOS, Outcome, ResultRow, RunRecord, own_libraries
from shadowbench.tables.columns import header_text
from shadowbench.tables.verdicts import Verdicts, ratio_text

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

FILTER_PICTURES = {
    "filtered-reference": "filtered reference",
    "error": "error: blue too dark, orange too lit",
}
"""Pictures of filtering methods, and what they are called."""

_LIKENESS = (
    *("rmse", "edge_band_rmse", "interior_rmse", "ssim", "flip", "leak_mean", "leak_p99"),
    *("approximation_rmse", "discretisation_rmse", "reference_error"),
)


@dataclass(frozen=True)
class Section:
    """A small table among a case's details: headings (none for plain facts) and lines of cells."""

    title: str
    columns: tuple[str, ...]
    lines: list[tuple[str, ...]]


@dataclass(frozen=True)
class Card:
    """One case, ready to be written out.

    Attributes:
        anchor: Its id in the page.
        title: The method with those parameters in which it differs from its neighbours.
        row: What was measured.
        result: Number of the result's picture, 0 for none.
        mask: Number of the failure mask, 0 if nothing fails.
        layers: (name, number) of the filtered reference, the error, and what the method itself drew.
        classes: Failure classes that the mask has.
        headline: The few figures that are always shown.
        sections: Everything else.
        command: The command line that measures this case again.
    """

    anchor: str
    title: str
    row: ResultRow
    result: int
    mask: int
    layers: list[tuple[str, int]]
    classes: list[str]
    headline: Facts
    sections: list[Section]
    command: str

    @property
    def outcome(self) -> Outcome:
        return self.row.outcome

    @property
    def files(self) -> list[tuple[str, str]]:
        """Return (name, artifact) of the pictures to be had in full size."""
        shown = ("result", "failures", *FILTER_PICTURES)
        return [(n, f) for n, f in self.row.artifacts.items() if n in shown or n.startswith(_OWN_PICTURE)]

    def as_json(self) -> dict[str, Any]:
        """Return what the script needs to show the case, control characters made visible."""
        shown = wording.shown
        return {
            "id": self.anchor,
            "title": shown(self.title),
            "method": shown(self.row.method_title),
            "outcome": self.outcome.value,
            "reason": shown(self.row.reason),
            "result": self.result,
            "mask": self.mask,
            "layers": [[shown(name), number] for name, number in self.layers],
            "sections": [
                [section.title, section.columns, [[shown(cell) for cell in line] for line in section.lines]]
                for section in self.sections
            ],
            "warnings": [shown(warning) for warning in self.row.warnings],
            "stderr": shown(self.row.stderr_tail),
            "command": self.command,
        }


def card_of(
    run: RunRecord, row: ResultRow, title: str, anchor: str, pool: PicturePool, verdicts: Verdicts | None = None
) -> Card:
    """Return a row's card; its pictures are asked of the pool.

    Args:
        run: The row's.
        row: What was measured.
        title: The card's heading.
        anchor: Its id in the page.
        pool: Of the page's pictures.
        verdicts: How the times of its view's cases compare.
    """
    result = row.artifacts.get("result")
    parts = _mask_parts(row)
    return Card(
        anchor=anchor,
        title=title,
        row=row,
        result=pool.picture(result, Priority.RESULT) if result else 0,
        mask=pool.mask(parts) if parts else 0,
        layers=_layers(row, pool),
        classes=[name for name, _ in parts],
        headline=_headline(row),
        sections=[section for section in _sections(run, row, verdicts) if section.lines],
        command=reproduce_command(row),
    )


def _mask_parts(row: ResultRow) -> list[tuple[str, str]]:
    """Return (failure class, artifact) of those classes that any receiver is in."""
    found = []
    for name in (*KINDS, CLASSIFIED):
        artifact = row.artifacts.get(f"mask-{name.replace('_', '-')}")
        if artifact is not None and getattr(row, f"{name}_count") != 0:
            found.append((name, artifact))
    return found


def _layers(row: ResultRow, pool: PicturePool) -> list[tuple[str, int]]:
    found = []
    for name, file in row.artifacts.items():
        if name in FILTER_PICTURES or name.startswith(_OWN_PICTURE):
            number = pool.picture(file, Priority.FURTHER)
            found.append((FILTER_PICTURES.get(name, name.removeprefix(_OWN_PICTURE)), number))
    return found


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


def _sections(run: RunRecord, row: ResultRow, verdicts: Verdicts | None) -> list[Section]:
    return [
        Section("Times", ("", "median", "95 % interval"), _times(row)),
        Section("Against the first case", ("", "times as long, by round", ""), _against(row, verdicts)),
        Section("Stages", ("", "median", "of build + shade"), _stages(row)),
        Section("Quality", ("", "value", "receivers"), _measures(row)),
        Section("Counters", ("", "value"), [(k, wording.count(v)) for k, v in row.counters.items()]),
        Section("Kept between frames", ("", "size"), [(k, wording.byte_size(v)) for k, v in row.kept.items()]),
        Section("Parameters", (), [(k, str(v)) for k, v in row.method_parameters.items()]),
        Section("Measured", (), [*_origin(run, row)]),
    ]


def _times(row: ResultRow) -> list[tuple[str, ...]]:
    found: list[tuple[str, ...]] = []
    for field, name in TIMES.items():
        median = getattr(row, f"{field}_ms")
        if median is not None:
            span = wording.interval(getattr(row, f"{field}_ms_low"), getattr(row, f"{field}_ms_high"))
            found.append((name, wording.milliseconds(median), span))
    if row.compile_ms is not None:
        found.append(("kernel compilation (not in any other time)", wording.milliseconds(row.compile_ms), ""))
    return found


def _against(row: ResultRow, verdicts: Verdicts | None) -> list[tuple[str, ...]]:
    """Return the ratios of the case's times to those of its comparison's first case."""
    found: list[tuple[str, ...]] = []
    for ratio, time in RATIOS.items():
        judgement = None if verdicts is None else verdicts.of(row, ratio)
        if judgement is not None:
            name = TIMES[time.removesuffix("_ms")]
            found.append((name, ratio_text(judgement.ratio), judgement.verdict.value))
    return found


def _stages(row: ResultRow) -> list[tuple[str, ...]]:
    """Stage medians and, as the last entry, what they leave of build + shade (medians need not add up exactly)."""
    total = (row.build_ms or 0.0) + (row.shade_ms or 0.0)
    if not row.stages or total <= 0.0:
        return [(name, wording.milliseconds(duration), "") for name, duration in row.stages.items()]
    rest = total - sum(row.stages.values()) if row.unexplained_ms is None else row.unexplained_ms
    durations = row.stages | {"not in any stage": max(0.0, rest)}
    return [
        (name, wording.milliseconds(duration), f"{round(min(100.0, 100.0 * duration / total), 1)} %")
        for name, duration in durations.items()
    ]


def _measures(row: ResultRow) -> list[tuple[str, ...]]:
    found: list[tuple[str, ...]] = []
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
        ("rounds", _rounds(row)),
        ("ended by", _ENDINGS.get(row.ended_by, row.ended_by)),
        ("one sample", _sample(row)),
        ("outliers", ", ".join(f"round {number + 1}" for number in row.outlier_rounds)),
        ("largest resident size", "" if row.peak_rss_bytes is None else wording.byte_size(row.peak_rss_bytes)),
        ("measured", wording.moment(row.measured_at) if row.measured_at else ""),
        *own_libraries(run, [row]).items(),
        ("code", row.code_version),
        ("case", row.case_key),
    ]
    return [fact for fact in facts if fact[1]]


_ENDINGS = {
    "interval": "the intervals: all are tight",
    "budget": "the time budget",
    "rounds": "the number of rounds",
}


def _rounds(row: ResultRow) -> str:
    if row.rounds is None or row.processes is None:
        return "" if row.rounds is None else str(row.rounds)
    return f"{row.rounds}, in {row.processes} process{'es' if row.processes > 1 else ''}"


def _sample(row: ResultRow) -> str:
    if row.warm_up_frames is None:
        return ""
    repeats = [f"{count} {name}{'s' if (count or 0) > 1 else ''}" for name, count in _repeats(row).items()]
    return f"{', '.join(repeats)}; after {row.warm_up_frames} frames to warm up"


def _repeats(row: ResultRow) -> dict[str, int | None]:
    return {"build": row.build_repeats, "shade": row.shade_repeats}


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
