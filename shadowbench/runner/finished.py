"""Which cases of a plan have their row, on whatever machine it was measured."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from shadowbench.identity import key_of
from shadowbench.rows import Outcome, ResultRow
from shadowbench.runner.cases import Case, Plan
from shadowbench.runner.row_making import case_columns


class Finished:
    """The outcomes of a run's cases so far.

    A case is known by what was asked for, not by its keys alone: those hold the machine, and a peer's library, where
    it was measured.

    Args:
        plan: The run's.
        rows: What the run has already.
    """

    def __init__(self, plan: Plan, rows: Iterable[ResultRow]) -> None:
        columns = tuple(case_columns(plan.cases[0])) if plan.cases else ()
        self._by_description: dict[str, Outcome] = {}
        self._by_key: dict[tuple[str, str], Outcome] = {}
        for row in rows:
            self._by_description[key_of({name: getattr(row, name) for name in columns})] = row.outcome
            self._by_key[row.experiment, row.case_key] = row.outcome

    def __bool__(self) -> bool:
        return bool(self._by_description)

    def add(self, case: Case, outcome: Outcome) -> None:
        """Note that a case has its row."""
        self._by_description[key_of(case_columns(case))] = outcome

    def outcome(self, case: Case) -> Outcome | None:
        """Return how a case ended, ``None`` if it has no row."""
        by_key = self._by_key.get((case.experiment, case.case_key))
        return self._by_description.get(key_of(case_columns(case)), by_key)

    def left(self, cases: Iterable[Case]) -> list[Case]:
        """Return those that have no row."""
        return [case for case in cases if self.outcome(case) is None]

    def baseline(self, cases: Sequence[Case], *, must_be_ok: bool = False) -> Case | None:
        """Return the first case of a comparison that was or may yet be measured well.

        Args:
            cases: The whole comparison.
            must_be_ok: Only one that was.
        """
        wanted = (Outcome.OK,) if must_be_ok else (Outcome.OK, None)
        return next((case for case in cases if case.obstacle is None and self.outcome(case) in wanted), None)
