"""Claims and their verdicts: what a run's rows say of the statements that its experiments hold.

The language in which an experiment file says what would make a claim true is documented in
:mod:`shadowbench.claim`; :mod:`shadowbench.tables.claim_tests` decides one test. A claim *holds* if each of its tests
holds in every group of its cases, *does not hold* if one of them fails, and is *undecided* otherwise: rows are missing
or not ok, the run is partial, or an interval lies on both sides.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from shadowbench.claim import Claim, claim_from
from shadowbench.rows import ResultRow, RunRecord
from shadowbench.statistics import differences_among
from shadowbench.tables.claim_tests import Finding, findings_of
from shadowbench.tables.decisions import Verdict, all_of

__all__ = ["ClaimAnswer", "Finding", "Verdict", "answer_claims", "answers_of"]


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


_NAMED = 3
"""Groups whose figures are given; of more, only the number is said."""


def answer_claims(run: RunRecord, rows: Sequence[ResultRow]) -> tuple[ClaimAnswer, ...]:
    """Return the verdicts on all claims of a run's experiments, in the order of the experiments and of their files.

    Args:
        run: The run; its ``definitions`` hold the claims.
        rows: Its rows, whatever their outcomes.

    Raises:
        ExperimentError: A claim that the run's record holds cannot be used.
    """
    return tuple(
        answer
        for definition in run.definitions
        for answer in answers_of(
            str(definition.get("name", "")),
            [claim_from(stored) for stored in definition.get("claims", ())],
            rows,
            source=str(definition.get("source", "")),
            case_count=definition.get("case_count"),
        )
    )


def answers_of(
    experiment: str,
    claims: Sequence[Claim],
    rows: Sequence[ResultRow],
    *,
    source: str = "",
    case_count: int | None = None,
) -> list[ClaimAnswer]:
    """Return the verdicts on an experiment's claims.

    Args:
        experiment: Its name.
        claims: They need not be those of the time when it was measured.
        rows: Rows, of which those of the experiment count.
        source: Where claims are made that do not say it themselves.
        case_count: Planned cases; with fewer rows nothing is said to hold.
    """
    own = [row for row in rows if row.experiment == experiment]
    missing = f"{len(own)} of {case_count} cases are measured" if len(own) < (case_count or 0) else ""
    return [_answer(claim, experiment, own, claim.source or source, missing) for claim in claims]


def _answer(claim: Claim, experiment: str, rows: Sequence[ResultRow], source: str, missing: str) -> ClaimAnswer:
    findings = _allowed_for([finding for test in claim.tests for finding in findings_of(test, rows)])
    verdict, evidence = all_of(finding.verdict for finding in findings), _evidence(findings)
    if missing and verdict is not Verdict.DOES_NOT_HOLD:
        if verdict is Verdict.HOLDS:
            evidence = f"so far it holds: {evidence}"
        verdict, evidence = Verdict.UNDECIDED, f"{missing}; {evidence}" if rows else "no case has been measured"
    keys = tuple(dict.fromkeys(key for finding in findings for key in finding.case_keys))
    return ClaimAnswer(claim.name, experiment, claim.statement, source, verdict, evidence, keys, tuple(findings))


def _allowed_for(findings: Sequence[Finding]) -> list[Finding]:
    """Return findings among which a failure is one that the number of a claim's comparisons does not explain.

    That a claim holds takes all of its comparisons, each at 95 %; that it does not takes one, and of twenty that lie on
    the bound one fails by chance. Failures of times therefore pass :func:`~shadowbench.statistics.differences_among`.
    """
    tested = [finding for finding in findings if finding.p_value is not None]
    differs = differences_among([finding.p_value for finding in tested if finding.p_value is not None])
    by_chance = {
        id(finding)
        for finding, differing in zip(tested, differs, strict=True)
        if finding.verdict is Verdict.DOES_NOT_HOLD and not differing
    }
    note = f"no failure beyond chance among {len(tested)} comparisons"
    return [
        replace(finding, verdict=Verdict.UNDECIDED, evidence=f"{finding.evidence} ({note})")
        if id(finding) in by_chance
        else finding
        for finding in findings
    ]


def _evidence(findings: Sequence[Finding]) -> str:
    """Return the figures of the groups that decide: those that fail, those that are open, or the closest to failing."""
    verdict = all_of(finding.verdict for finding in findings)
    deciding = [finding for finding in findings if finding.verdict is verdict]
    clearest_first = verdict is Verdict.DOES_NOT_HOLD
    named = deciding
    if len(deciding) > _NAMED:
        named = sorted(deciding, key=lambda finding: finding.margin, reverse=clearest_first)[
            : _NAMED if clearest_first else 1
        ]
    figures = "; ".join(_in_its_group(finding) for finding in named)
    if len(findings) == 1:
        return figures
    count = f"{len(deciding)} of {len(findings)}"
    match verdict:
        case Verdict.HOLDS:
            return figures if len(findings) <= _NAMED else f"in all {len(findings)} comparisons; the closest: {figures}"
        case Verdict.DOES_NOT_HOLD:
            return f"fails in {count} comparisons: {figures}" + ("; …" if len(named) < len(deciding) else "")
        case _:
            return f"open in {count} comparisons: {figures}" + ("; …" if len(named) < len(deciding) else "")


def _in_its_group(finding: Finding) -> str:
    return f"{finding.group}: {finding.evidence}" if finding.group else finding.evidence
