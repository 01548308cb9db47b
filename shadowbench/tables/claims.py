"""Claims and their verdicts: what a run's rows say of the statements that its experiments hold.

The language in which an experiment file says what would make a claim true is documented in
:mod:`shadowbench.claim`; :mod:`shadowbench.tables.claim_tests` decides one test. A claim *holds* if each of its tests
holds in every group of its cases, *does not hold* if one of them fails, and is *undecided* otherwise: rows are missing
or not ok, the run is partial, or an interval lies on both sides.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

from shadowbench.rows import ResultRow, RunRecord


class Verdict(StrEnum):
    """What is said of a claim."""

    HOLDS = "holds"
    DOES_NOT_HOLD = "does not hold"
    UNDECIDED = "undecided"


@dataclass(frozen=True)
class Finding:
    """What one group of cases says.

    Attributes:
        group: What tells the group from the others, ``kernel 3, resolution 512``; empty if there is one only.
        quantity: What was compared, ``dynamic_frame_ms of esm / vsm``.
        verdict: What it says.
        evidence: The figures, in one line.
        value, low, high: The figure that decides and its interval, equal where it is exact; ``None`` where there is
            none.
        case_keys: The cases.
    """

    group: str
    quantity: str
    verdict: Verdict
    evidence: str
    value: float | None = None
    low: float | None = None
    high: float | None = None
    case_keys: tuple[str, ...] = ()


@dataclass(frozen=True)
class ClaimAnswer:
    """A claim's verdict.

    Attributes:
        name: The claim's name, unique in its experiment.
        experiment: The experiment that holds it.
        statement: What is claimed.
        source: Paper and section.
        verdict: What the rows say.
        evidence: Why, in one line: the groups and figures that decide.
        case_keys: The cases that it rests on.
        findings: Every group of every test.
    """

    name: str
    experiment: str
    statement: str
    source: str
    verdict: Verdict
    evidence: str
    case_keys: tuple[str, ...] = ()
    findings: tuple[Finding, ...] = ()


def answer_claims(run: RunRecord, rows: Sequence[ResultRow]) -> tuple[ClaimAnswer, ...]:
    """Return the verdicts on all claims of a run's experiments, in the order of the experiments and of their files.

    Args:
        run: The run; its ``definitions`` hold the claims.
        rows: Its rows, whatever their outcomes.
    """
    return tuple(
        ClaimAnswer(
            str(claim["name"]),
            str(definition.get("name", "")),
            str(claim["statement"]),
            str(claim.get("source", "")),
            Verdict.UNDECIDED,
            "no row decides it" if rows else "no case has been measured",
        )
        for definition in run.definitions
        for claim in definition.get("claims", ())
    )
