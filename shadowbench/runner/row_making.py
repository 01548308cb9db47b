"""Result rows from what was found: one for every case, however it ended."""

from __future__ import annotations

import datetime as dt
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from statistics import median
from typing import Any

from shadowbench.rows import Outcome, ResultRow, RunRecord
from shadowbench.runner.cases import Case
from shadowbench.runner.rounds import TIGHT, Interval, interval_of, sums


@dataclass
class Timing:
    """What the rounds of one case gave.

    Attributes:
        build, shade: Durations by round [ms].
        stages: Stage durations by round [ms].
    """

    build: list[float] = field(default_factory=list)
    shade: list[float] = field(default_factory=list)
    stages: list[dict[str, float]] = field(default_factory=list)

    def intervals(self, camera: Sequence[float], *, view_dependent: bool) -> dict[str, Interval]:
        """Return the intervals of all durations, by the row's column without ``_ms``.

        Args:
            camera: The camera pass's durations by round; empty if it could not be timed.
            view_dependent: Whether ``build`` belongs to every frame.
        """
        series: dict[str, list[float]] = {"build": self.build, "shade": self.shade}
        if camera:
            dynamic = sums(camera, self.build, self.shade)
            series["camera"] = list(camera)
            series["dynamic_frame"] = dynamic
            series["static_frame"] = dynamic if view_dependent else sums(camera, self.shade)
        return {name: interval_of(samples) for name, samples in series.items()}

    @property
    def is_tight(self) -> bool:
        """Whether more rounds would tell little more about the frame and its dearer part."""
        return interval_of(self.shade).is_tight and interval_of(sums(self.build, self.shade)).is_tight


def now() -> str:
    """Return the time, ISO 8601, UTC."""
    return dt.datetime.now(dt.UTC).isoformat(timespec="seconds")


def ended_row(case: Case, run: RunRecord, outcome: Outcome, reason: str, stderr_tail: str = "") -> ResultRow:
    """Return the row of a case that was not measured."""
    return ResultRow(**_common(case, run), outcome=outcome, reason=reason, stderr_tail=stderr_tail)


def measured_row(
    case: Case,
    run: RunRecord,
    *,
    comparison: str,
    compile_ms: float,
    timing: Timing,
    camera: Sequence[float],
    baseline: Timing | None,
    measured: Mapping[str, Any],
    artifacts: dict[str, str],
) -> ResultRow:
    """Return the row of a case that went well.

    Args:
        case: The case.
        run: Its run.
        comparison: What cases timed in the same rounds have in common.
        compile_ms: Compiling and loading kernels.
        timing: Its rounds.
        camera: The camera pass in the same rounds; empty if it could not be timed.
        baseline: The comparison's first case in the same rounds, where that case's own row has other rounds.
        measured: What :meth:`shadowbench.runner.case_host.CaseHost.measure` returned.
        artifacts: Names of the kept pictures.
    """
    columns = _common(case, run) | measured["columns"]
    intervals = timing.intervals(camera, view_dependent=measured["view_dependent"])
    for name, interval in intervals.items():
        columns[f"{name}_ms"] = interval.median
        columns[f"{name}_ms_low"] = interval.low
        columns[f"{name}_ms_high"] = interval.high
    samples = {"build": timing.build, "shade": timing.shade, "camera": list(camera)}
    if baseline is not None:
        samples |= {"baseline build": baseline.build, "baseline shade": baseline.shade}
    columns["warnings"] = [*columns["warnings"], *measured["warnings"], *_timing_warnings(timing, intervals)]
    stage_names = dict.fromkeys(name for stages in timing.stages for name in stages)
    return ResultRow(
        **columns,
        outcome=Outcome.OK,
        comparison=comparison,
        self_hit=measured["self_hit"],
        visibility_digest=measured["visibility_digest"],
        rounds=len(timing.shade),
        compile_ms=compile_ms,
        bytes_kept=sum(measured["kept"].values()),
        peak_rss_bytes=measured["peak_rss_bytes"],
        stages={name: median(stages.get(name, 0.0) for stages in timing.stages) for name in stage_names},
        counters=measured["counters"],
        kept=measured["kept"],
        samples={name: durations for name, durations in samples.items() if durations},
        artifacts=artifacts,
    )


def case_columns(case: Case) -> dict[str, Any]:
    """Return the columns that tell a case from the others of its run, on whatever machine it is measured."""
    view = case.view
    return {
        "experiment": case.experiment,
        "scene": view.scene,
        "scene_parameters": view.scene_parameters,
        "method": case.method,
        "method_parameters": case.method_parameters,
        "light": view.light,
        "camera": view.camera,
        "width": view.width,
        "height": view.height,
        "pixel_samples": view.pixel_samples,
        "layers": view.layers,
        "device": case.device,
        "threads": case.threads,
    }


def _common(case: Case, run: RunRecord) -> dict[str, Any]:
    return case_columns(case) | {
        "run_id": run.run_id,
        "case_key": case.case_key,
        "quality_key": case.quality_key,
        "triangles": case.view.triangles,
        "method_title": case.method_title,
        "warnings": list(case.view.notes),
        "machine": run.machine,
        "environment": run.environment | {"libraries": run.environment.get("libraries", {}) | case.libraries},
        "code_version": run.code_version,
        "measured_at": now(),
    }


def _timing_warnings(timing: Timing, intervals: Mapping[str, Interval]) -> list[str]:
    shade = intervals["shade"]
    if shade.low is None or shade.high is None:
        return ["too few rounds fitted in the time budget for an interval; a larger --budget gives more"]
    if not timing.is_tight:
        # the interval itself stands beside the median; one sentence for all cases keeps the tables' notes short
        return [f"95 % interval wider than ±{TIGHT:.0%}; a quieter machine or a larger --budget narrows it"]
    return []
