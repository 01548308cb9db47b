"""What a reader should know within ten seconds: how the cases ended, what won, on which machine, what to beware of.

Only figures that a row holds are shown. Two durations that their rounds do not tell apart (or, of different rounds,
whose 95 % intervals overlap) are named together: the summary does not call a winner that the measurement did not
decide.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from shadowbench.report import wording
from shadowbench.report.cards import Card, Facts
from shadowbench.report.embedding import Pool
from shadowbench.report.views import SceneView
from shadowbench.rows import Outcome, ResultRow, RunRecord, RunStatus, own_libraries
from shadowbench.statistics import Verdict as Judged
from shadowbench.statistics import judge
from shadowbench.tables.claims import ClaimAnswer
from shadowbench.tables.claims import Verdict as ClaimVerdict
from shadowbench.tables.verdicts import contrast_of

_NAMED = 3
"""Cases that are named; of more, only the number is said."""

_MOST_TITLES = 2
"""Experiments whose titles make the page's."""

_FIGURE = re.compile(r"\d+(?:\.\d+)?")

Span = tuple[float, float, float]
"""(low, estimate, high)."""


@dataclass(frozen=True)
class Tally:
    """How many cases ended in an outcome."""

    outcome: Outcome
    count: int


@dataclass(frozen=True)
class Finding:
    """One cell of the summary.

    Attributes:
        cases: (title, anchor) of the winner and of the first of those that it does not clearly beat.
        more: How many others it does not clearly beat.
        figures: The winner's.
    """

    cases: list[tuple[str, str]]
    more: int
    figures: str


@dataclass(frozen=True)
class Verdict:
    """What won in a view; a cell is ``None`` where no case qualifies."""

    view: SceneView
    exact: Finding | None
    approximate: Finding | None
    fastest: Finding | None


@dataclass(frozen=True)
class Warned:
    """A warning and the cases that have it.

    Attributes:
        text: As the first case says it.
        cases: (title, anchor) of the first few.
        more: How many other cases have it.
        varies: Whether some say it with other figures.
    """

    text: str
    cases: list[tuple[str, str]]
    more: int
    varies: bool


@dataclass(frozen=True)
class Summary:
    """The head of the page.

    Attributes:
        title: What was measured.
        subtitle: The experiments' names, where the title does not say them.
        tallies: How the cases ended.
        claims: (verdict, number of claims).
        extent: (number, what) of what was compared.
        verdicts: What won, by view.
        notices: What a reader must know before believing any of it.
        warnings: Of all cases, the same one once.
        facts: When and where.
        environment: Everything that was recorded about it.
    """

    title: str
    subtitle: str
    tallies: list[Tally]
    claims: list[tuple[ClaimVerdict, int]]
    extent: list[tuple[int, str]]
    verdicts: list[Verdict]
    notices: list[str]
    warnings: list[Warned]
    facts: Facts
    environment: Facts


def summarize(
    run: RunRecord,
    rows: Sequence[ResultRow],
    views: Sequence[SceneView],
    claims: Sequence[ClaimAnswer] = (),
    pool: Pool | None = None,
    notices: Sequence[str] = (),
) -> Summary:
    """Return the head of the page.

    Args:
        run, rows: What was measured.
        views: The gallery.
        claims: With their verdicts.
        pool: What became of the pictures.
        notices: What else a reader must know.
    """
    outcomes = Counter(row.outcome for row in rows)
    titles = _titles(run)
    answers = Counter(claim.verdict for claim in claims)
    return Summary(
        title=run.title or _title(titles),
        subtitle=", ".join(run.experiments) if run.title or len(titles) > _MOST_TITLES else "",
        tallies=[Tally(outcome, outcomes[outcome]) for outcome in Outcome if outcomes[outcome]],
        claims=[(verdict, answers[verdict]) for verdict in ClaimVerdict if answers[verdict]],
        extent=_extent(rows, views),
        verdicts=[verdict for verdict in map(_verdict, views) if verdict.fastest is not None],
        notices=[*_notices(run, rows), *notices, *_picture_notices(pool or Pool())],
        warnings=_warnings(views),
        facts=_facts(run),
        environment=[*flattened(run.environment), *own_libraries(run, rows).items()],
    )


def _titles(run: RunRecord) -> list[str]:
    known = {definition.get("name"): definition.get("title") for definition in run.definitions}
    return [str(known.get(name) or name) for name in run.experiments]


def _title(titles: Sequence[str]) -> str:
    if len(titles) > _MOST_TITLES:
        return f"{titles[0]}, and {len(titles) - 1} more experiments"
    return ", ".join(titles) or "shadowbench run"


def _warnings(views: Sequence[SceneView]) -> list[Warned]:
    found: dict[str, list[tuple[str, Card]]] = {}
    for view in views:
        for card in view.cards:
            for warning in card.row.warnings:
                found.setdefault(_FIGURE.sub("0", warning), []).append((warning, card))
    return [
        Warned(
            text=said[0][0],
            cases=[(card.title, card.anchor) for _, card in said[:_NAMED]],
            more=max(0, len(said) - _NAMED),
            varies=len({text for text, _ in said}) > 1,
        )
        for said in found.values()
    ]


def _verdict(view: SceneView) -> Verdict:
    measured = {c.anchor: c.row for c in view.cards if c.outcome is Outcome.OK and c.row.dynamic_frame_ms is not None}
    scored = {anchor: row for anchor, row in measured.items() if row.failure_count is not None}
    exact = {anchor: row for anchor, row in scored.items() if row.failure_count == 0}
    inexact = {anchor: row for anchor, row in scored.items() if row.failure_count}
    return Verdict(
        view,
        exact=_finding(view, exact, _duration),
        approximate=_finding(view, inexact, _failure),
        fastest=_finding(view, measured, _duration),
    )


def _duration(row: ResultRow) -> Span:
    median = row.dynamic_frame_ms or 0.0
    low, high = row.dynamic_frame_ms_low, row.dynamic_frame_ms_high
    return (median if low is None else low, median, median if high is None else high)


def _failure(row: ResultRow) -> Span:
    percent = row.failure_percent or 0.0  # a count over all receivers: it has no interval
    return (percent, percent, percent)


def _finding(view: SceneView, candidates: dict[str, ResultRow], span: Callable[[ResultRow], Span]) -> Finding | None:
    """Name the candidate with the smallest estimate, and those that it does not clearly beat.

    Of durations from the same rounds, the rounds' ratios tell; else those whose interval begins before its ends.
    """
    if not candidates:
        return None
    order = sorted(candidates, key=lambda anchor: span(candidates[anchor])[1])
    best = candidates[order[0]]
    slower = _slower(best, candidates) if span is _duration else {}
    tied = [
        anchor
        for anchor in order
        if not slower.get(anchor, span(candidates[anchor])[0] > span(best)[2] and anchor != order[0])
    ]
    title = {card.anchor: card.title for card in view.cards}
    figures = f"{wording.milliseconds(best.dynamic_frame_ms)} a dynamic frame"
    if best.failure_percent is not None:
        figures = f"{wording.percent(best.failure_percent)} failing, {figures}"
    return Finding([(title[anchor], anchor) for anchor in tied[:_NAMED]], max(0, len(tied) - _NAMED), figures)


def _slower(best: ResultRow, candidates: dict[str, ResultRow]) -> dict[str, bool]:
    """Return which of those that were timed in the same rounds as the best are slower, judged together."""
    contrasts = {
        anchor: contrast
        for anchor, row in candidates.items()
        if row is not best and row.comparison == best.comparison
        if (contrast := contrast_of(row, best, "dynamic_frame_ms")) is not None
    }
    judged = zip(contrasts, judge(list(contrasts.values())), strict=True)
    return {anchor: judgement.verdict is Judged.SLOWER for anchor, judgement in judged}


def _notices(run: RunRecord, rows: Sequence[ResultRow]) -> list[str]:
    notices = []
    if run.status is RunStatus.INTERRUPTED:
        notices.append("This run was interrupted; what had been finished is shown.")
    elif run.status is RunStatus.FAILED:
        notices.append("This run broke off; what had been finished is shown.")
    elif run.status is RunStatus.RUNNING:
        notices.append("This run had not ended when the page was written.")
    missing = run.case_count - len(rows)
    if missing > 0:
        notices.append(f"{missing} of {run.case_count} planned cases have not been measured.")
    failed = sum(row.outcome.is_failure for row in rows)
    if failed:
        notices.append(f"{failed} {'case' if failed == 1 else 'cases'} failed; each says why in its place below.")
    return notices


def _picture_notices(pool: Pool) -> list[str]:
    """Say what the page's bound on its size cost its pictures."""
    notices = []
    if pool.reduced_to:
        notices.append(f"To keep this page small, pictures are as little as {pool.reduced_to} pixels wide.")
    if pool.left_out:
        notices.append(
            f"To keep this page small, {len(pool.left_out)} of the maps, errors and structures that cases show besides "
            "their result were left out; each case says which."
        )
    return notices


def _extent(rows: Sequence[ResultRow], views: Sequence[SceneView]) -> list[tuple[int, str]]:
    counts = [
        (len({row.experiment for row in rows}), "experiment"),
        (len({row.method for row in rows}), "method"),
        (len(views), "view"),
    ]
    return [(count, noun if count == 1 else f"{noun}s") for count, noun in counts if count]


def _facts(run: RunRecord) -> Facts:
    facts = [
        ("run", run.run_id),
        ("begun", wording.moment(run.created_at)),
        ("ended", wording.moment(run.finished_at) if run.finished_at else ""),
        ("machine", run.machine),
        ("code", run.code_version),
    ]
    return [fact for fact in facts if fact[1]]


def flattened(environment: dict[str, Any], prefix: str = "") -> Facts:
    """Return nested names and values as one list, ``outer, inner`` for each name."""
    facts: Facts = []
    for key, value in environment.items():
        name = f"{prefix}{key}".replace("_", " ")
        if isinstance(value, dict):
            facts += flattened(value, prefix=f"{name}, ")
        elif value not in (None, "", [], ()):
            facts.append((name, ", ".join(map(str, value)) if isinstance(value, (list, tuple)) else str(value)))
    return facts
