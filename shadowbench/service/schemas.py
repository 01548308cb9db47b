"""What travels, for the API's description: schemas derived from the rows' own models, so that they cannot fall behind.

Nothing is validated by these models: what is uploaded is read by :mod:`shadowbench.store.documents`, which is stricter
and says where a fault is, and answers are made by their pages. Tests hold both to the schemas.
"""

from __future__ import annotations

from typing import Annotated, Any

from fastapi import FastAPI
from pydantic import BaseModel, Field
from pydantic.json_schema import models_json_schema

from shadowbench.rows import Outcome, ResultRow, RunRecord, RunStatus
from shadowbench.service.side_by_side_schemas import Comparison, History, Leaderboard, Said
from shadowbench.store.artifacts import ARTIFACT_NAME
from shadowbench.store.documents import MOST_ROWS, RUN_ID
from shadowbench.store.uploads import Kept
from shadowbench.tables.decisions import Verdict

MOST_NAMES = 100_000
"""Names of pictures in one question."""

_REFERENCE = "#/components/schemas/{model}"

_ArtifactName = Annotated[str, Field(pattern=f"^{ARTIFACT_NAME.pattern}$")]


class Row(ResultRow):
    """A case's result; null where a measure does not apply, or where a stage or sample is not a number."""

    stages: dict[str, float | None] = Field(  # type: ignore[assignment]
        default_factory=dict, description=ResultRow.model_fields["stages"].description
    )
    samples: dict[str, list[float | None]] = Field(  # type: ignore[assignment]
        default_factory=dict, description=ResultRow.model_fields["samples"].description
    )
    artifacts: dict[str, _ArtifactName] = Field(
        default_factory=dict, description=ResultRow.model_fields["artifacts"].description
    )


class EndedRun(RunRecord):
    """A run that may be uploaded: it has ended, and its id can stand in an address."""

    run_id: str = Field(pattern=f"^{RUN_ID}$", description="unique for ever; the same as in the address")
    finished_at: str = Field(description="end, ISO 8601, UTC")


class RunUpload(Said):
    """A run and all its rows."""

    run: EndedRun
    rows: list[Row] = Field(
        max_length=MOST_ROWS, description="each names the run; a complete run has case_count of them"
    )


class ArtifactNames(Said):
    """Names of pictures: SHA-256 and suffix."""

    names: list[str] = Field(max_length=MOST_NAMES)


class MissingArtifacts(Said):
    """Those of them that the service does not have."""

    missing: list[str]


class KeptPicture(Said):
    """A picture that is on the disk."""

    name: str


class KeptRun(Said):
    """A run that is on the disk."""

    run_id: str
    kept: Kept
    row_count: int
    digest: str = Field(description="SHA-256 of the run's and its rows' documents")


class ListedRun(Said):
    """A run as lists show it."""

    run_id: str
    title: str
    experiments: list[str]
    created_at: str
    finished_at: str | None
    status: RunStatus
    case_count: int
    machine: str
    code_version: str
    outcomes: dict[Outcome, int]
    is_uploaded: bool


class RunPage(Said):
    """Some runs, newest first."""

    runs: list[ListedRun]
    total: int = Field(description="of all that were asked for")
    next: str | None = Field(description="what `after` must be for the next page")


class ClaimVerdict(Said):
    """What a paper claims, and whether it holds."""

    name: str
    experiment: str
    statement: str
    source: str
    verdict: Verdict
    evidence: str
    case_keys: list[str]


class RunClaims(Said):
    """The claims of a run's experiments."""

    run_id: str
    claims: list[ClaimVerdict]


class WholeRun(Said):
    """A run with its rows, without their samples."""

    run: RunRecord
    rows: list[Row]
    claims: list[ClaimVerdict]


class ExperimentNames(Said):
    """All experiments."""

    experiments: list[str]


class MethodNames(Said):
    """All methods."""

    methods: list[str]


class Machine(Said):
    """A machine with what it was at its last run."""

    machine: str
    runs: int
    first: str
    last: str
    last_run: str
    environment: dict[str, Any]


class Machines(Said):
    """All machines."""

    machines: list[Machine]


class Health(Said):
    """The service runs and reaches its database."""

    status: str
    version: str


ANSWERS: dict[str, type[BaseModel]] = {
    "runs": RunPage,
    "run": WholeRun,
    "claims": RunClaims,
    "case": Row,
    "experiments": ExperimentNames,
    "leaderboard": Leaderboard,
    "methods": MethodNames,
    "history": History,
    "machines": Machines,
    "compare": Comparison,
}
"""What each route for readers answers as JSON."""

_MODELS: tuple[type[BaseModel], ...] = (
    RunUpload,
    ArtifactNames,
    MissingArtifacts,
    KeptPicture,
    KeptRun,
    Health,
    *ANSWERS.values(),
)


def content(model: type[BaseModel]) -> dict[str, Any]:
    """Return the part of an OpenAPI document that says what a JSON body is."""
    return {"application/json": {"schema": {"$ref": _REFERENCE.format(model=model.__name__)}}}


def install(app: FastAPI) -> None:
    """Put the models into the application's description of itself."""
    made = app.openapi

    def openapi() -> dict[str, Any]:
        document = made()
        known = document.setdefault("components", {}).setdefault("schemas", {})
        if RunUpload.__name__ not in known:
            _, found = models_json_schema([(model, "validation") for model in _MODELS], ref_template=_REFERENCE)
            known |= found["$defs"]
        return document

    app.openapi = openapi  # type: ignore[method-assign]
