"""What answers that set measurements side by side are: leaderboards, histories and comparisons, field by field.

Columns of rows keep their names, and with the names come their descriptions and units. Like everything that
:mod:`shadowbench.service.schemas` puts into the API's description, nothing is validated by these models; tests hold the
answers to them.
"""

from __future__ import annotations

from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field, GetJsonSchemaHandler
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema

from shadowbench.rows import Outcome, ResultRow
from shadowbench.tables.comparing import Kind, Pixels


class Said(BaseModel):
    """An object that has these members and no others."""

    model_config = ConfigDict(extra="forbid")


class _Columns(Said):
    @classmethod
    def __get_pydantic_json_schema__(cls, core: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchemaValue:
        schema = handler(core)
        for name, own in handler.resolve_ref_schema(schema)["properties"].items():
            column = ResultRow.model_fields.get(name)
            if column is not None and column.description:
                own.setdefault("description", column.description)
            if column is not None and isinstance(column.json_schema_extra, dict):
                own |= column.json_schema_extra
        return schema


class ViewName(Said):
    """A view that there is to choose."""

    key: str = Field(description="what `view` must be for it")
    title: str


class View(_Columns, ViewName):
    """What rows share whose measures may be compared."""

    scene: str
    scene_parameters: dict[str, Any]
    light: str
    camera: str
    width: int
    height: int
    pixel_samples: int
    layers: int
    moving: str


class TechniqueName(Said):
    """A technique that there is to choose."""

    key: str = Field(description="what `technique` must be for it")
    label: str = Field(description="its method, and what tells it apart from the others")


class Technique(_Columns, TechniqueName):
    """A method with its parameters, and how it was run."""

    method: str
    method_title: str
    method_parameters: dict[str, Any]
    moving: str
    device: str
    threads: int


class _Place(_Columns):
    run_id: str
    case_key: str
    technique_key: str = Field(description="the technique's `key`")
    machine: str
    code_version: str
    measured_at: str
    outcome: Outcome
    reason: str


class VersionQuality(_Place):
    """What a technique gets wrong in one version: its newest measured case on any machine."""

    visibility_digest: str
    failure_percent: float | None
    false_lit_percent: float | None
    false_shadow_percent: float | None
    acne_percent: float | None
    peter_panning_percent: float | None
    rmse: float | None
    ssim: float | None
    flip: float | None
    leak_mean: float | None
    machines: int = Field(description="machines that measured it in this version")
    differs: bool = Field(description="whether pixels differ between them")


class VersionTimes(_Place):
    """What a technique costs in one version, on the machine that the leaderboard names."""

    bytes_kept: int | None
    build_ms: float | None
    build_ms_low: float | None
    build_ms_high: float | None
    shade_ms: float | None
    shade_ms_low: float | None
    shade_ms_high: float | None
    static_frame_ms: float | None
    static_frame_ms_low: float | None
    static_frame_ms_high: float | None
    dynamic_frame_ms: float | None
    dynamic_frame_ms_low: float | None
    dynamic_frame_ms_high: float | None


class LeaderboardLine(Said):
    """A technique; versions that have no case of it are left out."""

    technique: Technique
    quality: dict[str, VersionQuality] = Field(description="version -> what it gets wrong")
    time: dict[str, VersionTimes] = Field(description="version -> what it costs")


class Leaderboard(_Columns):
    """An experiment's techniques in one view."""

    experiment: str
    view: View
    views: list[View] = Field(description="all that there are to choose")
    machine: str = Field(description="whose times these are")
    machines: list[str] = Field(description="all that there are to choose, the one that was measured on last first")
    versions: list[str] = Field(description="those shown, newest first")
    all_versions: list[str] = Field(description="all that there are to choose, newest first")
    sort: str = Field(description="column that the lines are ordered by, in the first of the versions that has it")
    line_count: int = Field(description="techniques that there are; `lines` has the first `limit` of them")
    lines: list[LeaderboardLine]


class HistoryPoint(_Columns):
    """One measurement of a method."""

    measured_at: str
    code_version: str
    run_id: str
    case_key: str
    outcome: Outcome
    value: float | None = Field(description="of the measure; null if the case has none")
    low: float | None = Field(description="lower end of a time's 95 % interval")
    high: float | None = Field(description="upper end of it")
    is_change: bool = Field(description="whether a new level begins here")


class HistoryChange(HistoryPoint):
    """The first measurement of a new level."""

    before: float = Field(description="median of the level before")
    after: float = Field(description="median of this level")
    ratio: float | None = Field(description="after / before; null if before is 0")


class History(_Columns):
    """A method's measurements of one technique, view and machine in the order of time."""

    method: str
    experiment: str
    view: View
    technique: Technique
    machine: str
    measure: str = Field(description="column that the values are of")
    experiments: list[str] = Field(description="all that there are to choose")
    views: list[ViewName] = Field(description="all that there are to choose")
    techniques: list[TechniqueName] = Field(description="all that there are to choose")
    machines: list[str] = Field(description="all that there are to choose, the one that was measured on last first")
    points: list[HistoryPoint] = Field(description="oldest first")
    changes: list[HistoryChange]


class ComparedRun(Said):
    """A run that is compared."""

    run_id: str
    created_at: str
    machine: str
    code_version: str


class ComparedTime(Said):
    """A time in both runs."""

    a_ms: float
    b_ms: float
    ratio: float = Field(description="B / A, estimated from all samples: below 1 is faster")
    low: float | None = Field(description="lower end of the ratio's interval; null if there is none")
    high: float | None = Field(description="upper end of it")
    verdict: Literal["faster", "slower", "no difference shown"]


_Numbers = dict[str, tuple[int | None, int | None]]


class ComparedCase(_Columns):
    """A case of either run, or of both."""

    experiment: str
    scene: str
    scene_parameters: dict[str, Any]
    method: str
    method_parameters: dict[str, Any]
    light: str
    camera: str
    width: int
    height: int
    pixel_samples: int
    layers: int
    moving: str
    device: str
    threads: int
    case_key_a: str | None = Field(description="its key in A; null if A has no such case")
    case_key_b: str | None = Field(description="its key in B; null if B has no such case")
    outcome_a: Outcome | None
    outcome_b: Outcome | None
    reason_a: str | None
    reason_b: str | None
    summary: str = Field(description="all of it in one line")
    changed: list[Kind]
    pixels: Pixels | None = Field(description="null unless both runs measured it")
    pixels_note: str = Field(description="why counts were compared instead of bits; empty for bits")
    counts: _Numbers = Field(description="failure counts that differ: name -> A's and B's")
    counters: _Numbers = Field(description="counters that differ: name -> A's and B's; null where a run has none")
    memory: _Numbers = Field(description="bytes kept that differ: name -> A's and B's; null where a run has none")
    times: dict[Literal["build", "shade"], ComparedTime] = Field(description="what was timed in both")
    times_note: str = Field(description="why times were not compared; empty if they were")


class Comparison(Said):
    """What changed from run A to run B, case by case."""

    a: ComparedRun
    b: ComparedRun
    threshold: float = Field(description="share of a time that a difference must reach")
    notes: list[str]
    cases: list[ComparedCase]
