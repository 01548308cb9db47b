"""The result row: the schema that measuring writes and everything else reads.

One :class:`ResultRow` per case, whatever its outcome. The names here are the columns of the store, of CSV and of
``shadowbench run --json`` alike; a measure that does not apply is ``None`` (empty), never 0. Long values (stages,
counters, kept arrays, samples) stand beside the row as name -> value. Nothing here imports Warp or a plugin.
"""

from __future__ import annotations

from collections.abc import Iterable
from enum import StrEnum
from typing import Any

from pydantic import BaseModel, ConfigDict, Field

from shadowbench.choices import EVERYTHING


class Outcome(StrEnum):
    """How a case ended. Every case ends in a row with one of these."""

    OK = "ok"
    SKIPPED = "skipped"
    ERROR = "error"
    CRASH = "crash"
    TIMEOUT = "timeout"
    OUT_OF_MEMORY = "out-of-memory"
    INVALID = "invalid"

    @property
    def is_failure(self) -> bool:
        """Whether the exit status must say so."""
        return self not in (Outcome.OK, Outcome.SKIPPED)


OUTCOME_MEANINGS: dict[Outcome, str] = {
    Outcome.OK: "measured",
    Outcome.SKIPPED: "the method said why it does not apply",
    Outcome.ERROR: "an exception, or a scene that could not be made",
    Outcome.CRASH: "the worker process died (a segmentation fault, say)",
    Outcome.TIMEOUT: "stopped after the time limit of a case",
    Outcome.OUT_OF_MEMORY: "stopped at the memory limit of a worker",
    Outcome.INVALID: "the result breaks the contract: NaN, out of range, unwritten, or different between repeats",
}


def _column(meaning: str, unit: str = "") -> Any:
    return Field(None, description=meaning, json_schema_extra={"unit": unit})


class ResultRow(BaseModel):
    """One case's result. Times are medians over the rounds with their 95 % interval (``_low``, ``_high``)."""

    model_config = ConfigDict(extra="forbid", ser_json_inf_nan="null")

    run_id: str = Field(description="run that measured it")
    experiment: str = Field(description="experiment it belongs to")
    comparison: str = Field("", description="cases with the same value were timed in the same interleaved rounds")
    baseline_case: str = Field(
        "", description="key of the comparison's first case: what its cases' times are compared with, by round"
    )
    case_key: str = Field(description="timing key: quality key, threads and machine")
    quality_key: str = Field(description="hash of scene, light, view, method, parameters, code and versions")
    scene: str = Field(description="scene plugin, or the mesh file's name")
    scene_parameters: dict[str, Any] = Field(default_factory=dict, description="all parameters, defaults included")
    triangles: int | None = _column("triangles of the scene over all instances", "triangles")
    method: str = Field(description="method plugin")
    method_title: str = Field("", description="its full name")
    method_parameters: dict[str, Any] = Field(default_factory=dict, description="all parameters, defaults included")
    light: str = Field(description="name of the scene's light")
    camera: str = Field(description="name of the scene's camera")
    width: int = Field(description="picture width [pixels]")
    height: int = Field(description="picture height [pixels]")
    pixel_samples: int = Field(1, description="samples of every pixel, each a receiver")
    layers: int = Field(1, description="most surfaces that a sample sees through translucent ones, each a receiver")
    moving: str = Field(EVERYTHING, description="what moves between two frames, so that build() is paid for it")
    device: str = Field(description="Warp device")
    threads: int = Field(description="threads the method may use")

    outcome: Outcome = Field(description="how the case ended")
    reason: str = Field("", description="why, for every outcome but ok; one line")
    stderr_tail: str = Field("", description="the end of what the worker wrote, for outcomes that need it")
    warnings: list[str] = Field(default_factory=list, description="notes about scene and measurement")

    receivers: int | None = _column("visible samples", "receivers")
    scored: int | None = _column(
        "valid, in the light's field of view and turned to it: what percentages are of", "receivers"
    )
    self_hit: str = Field("", description="how the method keeps a surface from shadowing itself")
    visibility_digest: str = Field("", description="hash of the visibility's bits: equal digests, equal pictures")
    changed_count: int | None = _column(
        "most receivers that changed between two repeats, of a method that need not repeat its bits", "receivers"
    )
    quality_run: str = Field(
        "",
        description="run that took the measures, counters and pictures, where it was an earlier one with the same"
        " quality key and the same bits; empty: this one",
    )

    rounds: int | None = _column("timed rounds", "rounds")
    processes: int | None = _column(
        "worker processes that the rounds were divided among, the case loaded anew in each", "1"
    )
    ended_by: str = Field(
        "", description="what ended the rounds: interval (tight), budget (spent) or rounds (their bound)"
    )
    warm_up_frames: int | None = _column("frames before the first round, the most of any process", "1")
    build_repeats: int | None = _column("builds within one sample, which is divided by them", "1")
    shade_repeats: int | None = _column("shades within one sample, which is divided by them", "1")
    build_ms: float | None = _column("build: paid when the light or a caster moves", "ms")
    build_ms_low: float | None = _column("", "ms")
    build_ms_high: float | None = _column("", "ms")
    shade_ms: float | None = _column("shade: paid every frame", "ms")
    shade_ms_low: float | None = _column("", "ms")
    shade_ms_high: float | None = _column("", "ms")
    camera_ms: float | None = _column("camera pass, timed in the same rounds", "ms")
    camera_ms_low: float | None = _column("", "ms")
    camera_ms_high: float | None = _column("", "ms")
    static_frame_ms: float | None = _column("camera pass + shade, summed round by round", "ms")
    static_frame_ms_low: float | None = _column("", "ms")
    static_frame_ms_high: float | None = _column("", "ms")
    dynamic_frame_ms: float | None = _column("camera pass + build + shade, summed round by round", "ms")
    dynamic_frame_ms_low: float | None = _column("", "ms")
    dynamic_frame_ms_high: float | None = _column("", "ms")
    unexplained_ms: float | None = _column("build + shade less all stages, median over the rounds", "ms")
    round_processes: list[int] = Field(default_factory=list, description="the process of each round, from 0")
    outlier_rounds: list[int] = Field(
        default_factory=list,
        description="rounds whose build + shade lies far out (Tukey: three interquartile distances beyond the"
        " quartiles, and 1 % from the median); they count like any other",
    )
    compile_ms: float | None = _column("kernel compilation, outside every other time", "ms")
    bytes_kept: int | None = _column("what stays alive between frames", "bytes")
    peak_rss_bytes: int | None = _column("largest resident size of the worker during the case", "bytes")

    false_lit_percent: float | None = _column("reference shadowed, result lit", "%")
    false_lit_count: int | None = _column("", "receivers")
    false_shadow_percent: float | None = _column("reference lit, result shadowed", "%")
    false_shadow_count: int | None = _column("", "receivers")
    failure_percent: float | None = _column("false lit + false shadow", "%")
    failure_count: int | None = _column("", "receivers")
    classified_percent: float | None = _column("the method's own failure test, of all pixels of the picture", "%")
    classified_count: int | None = _column("", "pixels")
    acne_percent: float | None = _column("false shadow outside the edge band", "%")
    acne_count: int | None = _column("", "receivers")
    peter_panning_percent: float | None = _column("false lit outside the edge band with a near blocker", "%")
    peter_panning_count: int | None = _column("", "receivers")
    edge_band_percent: float | None = _column("failures within the edge band, of the receivers in it", "%")
    edge_band_count: int | None = _column("", "receivers")
    interior_percent: float | None = _column("failures outside the edge band, of the receivers there", "%")
    interior_count: int | None = _column("", "receivers")
    turned_away_percent: float | None = _column("lit receivers among those turned away from the light", "%")
    turned_away_count: int | None = _column("", "receivers")
    rmse: float | None = _column(
        "root mean square difference from the method's reference: of a filtering method the hard truth filtered with"
        " its kernel, of any other the hard truth",
        "1",
    )
    edge_band_rmse: float | None = _column("the same in the edge band and where the method's reference is between", "1")
    interior_rmse: float | None = _column("the same over the other scored receivers", "1")
    ssim: float | None = _column("structural similarity of the pictures of visibility and of that reference", "1")
    flip: float | None = _column("FLIP difference of the same pictures", "1")
    leak_mean: float | None = _column("mean visibility where the method's reference is 0", "1")
    leak_p99: float | None = _column("99th percentile of that", "1")
    approximation_rmse: float | None = _column(
        "root mean square difference from the mean of depth tests with the method's kernel on its own map", "1"
    )
    discretisation_rmse: float | None = _column("difference of that mean from the filtered reference", "1")
    reference_error: float | None = _column("the filtered reference's own convergence error, estimated", "1")

    machine: str = Field("", description="machine key: processor, cores, memory, operating system")
    environment: dict[str, Any] = Field(
        default_factory=dict,
        description="versions, hardware and how it is set, the method's own libraries, and what the machine did:"
        " load_before, load_after (1, 5, 15 minutes), cores_used_by_others and cores_stolen during the rounds",
    )
    code_version: str = Field("", description="version of shadowbench and, in a checkout, its commit")
    measured_at: str = Field("", description="end of the case, ISO 8601, UTC")

    stages: dict[str, float] = Field(default_factory=dict, description="stage -> median duration [ms]")
    counters: dict[str, int] = Field(default_factory=dict, description="counter -> value, equal on every machine")
    kept: dict[str, int] = Field(default_factory=dict, description="array -> bytes kept between frames")
    samples: dict[str, list[float]] = Field(
        default_factory=dict, description="build, shade, camera, stages.NAME -> every duration, by round [ms]"
    )
    artifacts: dict[str, str] = Field(
        default_factory=dict, description="picture or mask -> file in the results folder's artifacts"
    )


FRAME_RATES = {"static_frame_fps": "static_frame_ms", "dynamic_frame_fps": "dynamic_frame_ms"}
"""Values that tables make of a row [frames per second], and the columns [ms] that they are the inverse of."""

RATIOS = {f"{name}_ratio": f"{name}_ms" for name in ("build", "shade", "camera", "static_frame", "dynamic_frame")}
"""Values that tables make of a row and its comparison's first case: how many times as long it takes, of which time."""

VERDICTS = {ratio.replace("_ratio", "_verdict"): ratio for ratio in RATIOS}
"""What a ratio says in words: ``faster``, ``slower`` or ``no difference shown``."""

LONG_FIELDS = ("stages", "counters", "kept", "samples", "artifacts")
"""Fields that stand beside the row as (case_key, name, value, unit)."""

LONG_UNITS = {"stages": "ms", "counters": "1", "kept": "bytes", "samples": "ms", "artifacts": "file"}


def column_unit(name: str) -> str:
    """Return the unit of a column, or an empty string."""
    extra = ResultRow.model_fields[name].json_schema_extra
    return str(extra.get("unit", "")) if isinstance(extra, dict) else ""


def method_label(method: str, parameters: dict[str, Any], *, only: set[str] | None = None) -> str:
    """Return ``method(key=value, …)`` with the parameters in ``only`` (all if ``None``), as tables print it."""
    shown = {k: v for k, v in parameters.items() if only is None or k in only}
    inside = ", ".join(f"{k}={_text(v)}" for k, v in shown.items())
    return f"{method}({inside})" if inside else method


def _text(value: Any) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)


class RunStatus(StrEnum):
    """Where a run stands."""

    RUNNING = "running"
    COMPLETE = "complete"
    INTERRUPTED = "interrupted"
    FAILED = "failed"

    @property
    def is_resumable(self) -> bool:
        """Whether cases may be missing, so that the same plan goes on with this run."""
        return self is not RunStatus.COMPLETE


RUN_STATUS_MEANINGS: dict[RunStatus, str] = {
    RunStatus.RUNNING: "begun and not ended; stays so when the process is killed",
    RunStatus.COMPLETE: "every planned case has its row, whatever its outcome",
    RunStatus.INTERRUPTED: "stopped by the user; what was finished is kept",
    RunStatus.FAILED: "the run itself broke off, not one of its cases",
}


class RunRecord(BaseModel):
    """One run: what was asked for, where and with what, and how it ended. Its rows name it by ``run_id``."""

    model_config = ConfigDict(extra="forbid")

    run_id: str = Field(min_length=1, description="unique for ever")
    plan_key: str = Field("", description="hash of the planned cases; equal for a run that is asked for again")
    title: str = Field("", description="what the user calls it")
    experiments: list[str] = Field(default_factory=list, description="names of the experiments, in the order asked for")
    argv: list[str] = Field(default_factory=list, description="the command line, to repeat it")
    created_at: str = Field(description="begin, ISO 8601, UTC")
    finished_at: str | None = Field(None, description="end, ISO 8601, UTC; none while running")
    status: RunStatus = Field(RunStatus.RUNNING, description="where it stands")
    case_count: int = Field(0, ge=0, description="planned cases; fewer rows than that make a partial run")
    machine: str = Field("", description="machine key: processor, cores, memory, operating system")
    environment: dict[str, Any] = Field(default_factory=dict, description="versions, hardware and how it is set")
    code_version: str = Field("", description="version of shadowbench and, in a checkout, its commit")
    definitions: list[dict[str, Any]] = Field(
        default_factory=list,
        description="each experiment as JSON (its fields, tables included, and case_count): its tables need no file",
    )
    method_defaults: dict[str, dict[str, Any]] = Field(
        default_factory=dict, description="method -> parameter -> default, so that labels can leave defaults out"
    )


def own_libraries(run: RunRecord, rows: Iterable[ResultRow]) -> dict[str, str]:
    """Return the versions that rows name beyond their run's: a peer's device, by name."""
    known = run.environment.get("libraries", {})
    named = [row.environment.get("libraries", {}) for row in rows]
    return {name: str(text) for libraries in named for name, text in libraries.items() if name not in known}
