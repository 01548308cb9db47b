"""Result rows from what was found: one for every case, however it ended."""

from __future__ import annotations

import datetime as dt
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from statistics import median
from typing import Any

from shadowbench.rows import Outcome, ResultRow, RunRecord
from shadowbench.runner.cases import Case
from shadowbench.runner.rounds import TIGHT, EndedBy, is_tight, sums
from shadowbench.statistics import Interval, has_two_modes, interval_of, median_over_processes, outliers


@dataclass
class Timing:
    """What the rounds of one case gave.

    Attributes:
        build, shade: Durations by round [ms].
        stages: Stage durations by round [ms].
        processes: By round, which process it was in.
        warm_up_frames: Before the first round, the most of any process.
    """

    build: list[float] = field(default_factory=list)
    shade: list[float] = field(default_factory=list)
    stages: list[dict[str, float]] = field(default_factory=list)
    processes: list[int] = field(default_factory=list)
    warm_up_frames: int = 0

    @property
    def frames(self) -> list[float]:
        """Build + shade by round [ms]."""
        return sums(self.build, self.shade)

    @property
    def unexplained(self) -> list[float]:
        """What no stage accounts for of build + shade, by round [ms]."""
        return [frame - sum(stages.values()) for frame, stages in zip(self.frames, self.stages, strict=True)]

    def stage_samples(self) -> dict[str, list[float]]:
        """Return each stage's durations by round [ms], 0 where a round had none."""
        names = dict.fromkeys(name for stages in self.stages for name in stages)
        return {name: [stages.get(name, 0.0) for stages in self.stages] for name in names}

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
        return {name: median_over_processes(samples, self.processes) for name, samples in series.items()}

    @property
    def is_tight(self) -> bool:
        """Whether more rounds would tell little more about the frame and its dearer part."""
        return is_tight(interval_of(self.shade)) and is_tight(interval_of(self.frames))


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
    surroundings: dict[str, Any],
    disturbances: Sequence[str],
    ended_by: EndedBy,
    repeats: Sequence[int],
    baseline_case: str,
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
        surroundings: What the machine did meanwhile, for the environment.
        disturbances: What of that is worth a warning.
        ended_by: The rule that ended them.
        repeats: Of build and of shade within a sample.
        baseline_case: Key of the case that those of its rounds are compared with.
        baseline: The comparison's first case in the same rounds, where that case's own row has other rounds.
        measured: What :meth:`shadowbench.runner.case_host.CaseHost.measure` returned, or the same from an earlier run
            (:func:`shadowbench.runner.reuse.reused`).
        artifacts: Names of the kept pictures.
    """
    columns = _common(case, run) | measured["columns"]
    intervals = timing.intervals(camera, view_dependent=measured["view_dependent"])
    for name, interval in intervals.items():
        columns[f"{name}_ms"] = interval.estimate
        columns[f"{name}_ms_low"] = interval.low
        columns[f"{name}_ms_high"] = interval.high
    samples = {"build": timing.build, "shade": timing.shade, "camera": list(camera)}
    if baseline is not None:
        samples |= {"baseline build": baseline.build, "baseline shade": baseline.shade}
    stages = timing.stage_samples()
    samples |= {f"stages.{name}": durations for name, durations in stages.items()}
    columns["warnings"] = [*columns["warnings"], *measured["warnings"], *_timing_warnings(timing), *disturbances]
    columns["environment"] |= surroundings
    return ResultRow(
        **columns,
        outcome=Outcome.OK,
        comparison=comparison,
        self_hit=measured["self_hit"],
        visibility_digest=measured["visibility_digest"],
        changed_count=measured["changed_count"],
        quality_run=measured.get("quality_run", ""),
        baseline_case=baseline_case,
        rounds=len(timing.shade),
        processes=len(set(timing.processes)),
        ended_by=ended_by,
        warm_up_frames=timing.warm_up_frames,
        build_repeats=repeats[0],
        shade_repeats=repeats[1],
        round_processes=timing.processes,
        outlier_rounds=outliers(timing.frames),
        unexplained_ms=median(timing.unexplained),
        compile_ms=compile_ms,
        bytes_kept=sum(measured["kept"].values()),
        peak_rss_bytes=measured["peak_rss_bytes"],
        stages={name: median(durations) for name, durations in stages.items()},
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
        "moving": view.moving,
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


def _timing_warnings(timing: Timing) -> list[str]:
    """Return what keeps the times from saying much, each with its remedy; without figures, so that notes stay few."""
    found = []
    if interval_of(timing.frames).low is None:
        found.append("too few rounds fitted in the time budget for an interval; a larger --budget gives more")
    elif not timing.is_tight:
        # the interval itself stands beside the median
        found.append(f"95 % interval wider than ±{TIGHT:.0%}; a quieter machine or a larger --budget narrows it")
    if has_two_modes(timing.frames):
        found.append(
            "the times fall into two groups, between which the median is chance; see the samples, keep the processor"
            " from changing its frequency, and end other programs"
        )
    return found
