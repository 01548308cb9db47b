"""What a table says of its cases' times against each other: ratios by round with corrected intervals, and verdicts.

Every case is compared with its comparison's first case, in the rounds that both were timed in. Where a comparison was
measured in several blocks, its first case was timed again in each: a case is then compared with those rounds. All
pairs of a table are judged together (:func:`shadowbench.statistics.judge`). A case without rounds in common with the
first one has no ratio.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from shadowbench.rows import RATIOS, VERDICTS, Outcome, ResultRow
from shadowbench.statistics import LAYOUT_SHIFT, Interval, Judgement, PairedContrast, judge, paired
from shadowbench.tables.numbers import number_text
from shadowbench.tables.quantities import durations_of

BASELINE = "baseline"
"""What stands in place of the first case's own verdict."""

_Identity = tuple[str, str, str]


def ratio_text(ratio: Interval) -> str:
    """Return ``[low, estimate, high]``, or the estimate alone where too few rounds were taken."""
    parts = (ratio.low, ratio.estimate, ratio.high)
    if ratio.low is None or ratio.high is None:
        return number_text(ratio.estimate, "ms")
    return f"[{', '.join(number_text(part, 'ms') for part in parts if part is not None)}]"


def contrast_of(row: ResultRow, first: ResultRow, name: str) -> PairedContrast | None:
    """Return what the rounds of two cases say about a time, or ``None`` if they have none in common.

    Args:
        row: A case.
        first: What to compare it with, of the same comparison.
        name: A time's column, ``shade_ms``.
    """
    if row.comparison == "" or row.outcome is not Outcome.OK or first.outcome is not Outcome.OK:
        return None
    others = first
    if row.comparison != first.comparison:  # another block, in which the first case was timed again
        again = {part: row.samples.get(f"baseline {part}", []) for part in ("build", "shade")}
        if row.baseline_case != first.case_key or not all(again.values()):
            return None
        others = first.model_copy(update={"samples": again | {"camera": row.samples.get("camera", [])}})
    durations, to_durations = durations_of(row, name), durations_of(others, name)
    if not durations or len(durations) != len(to_durations):
        return None
    return paired(durations, to_durations, row.round_processes or None)


class Verdicts:
    """The ratios and verdicts of one table.

    Args:
        rows: The table's.
        known: Those of its experiment, among which the first cases are.
        names: The table's values; of these, ratios and verdicts are judged.
    """

    def __init__(self, rows: Sequence[ResultRow], known: Iterable[ResultRow], names: Iterable[str]) -> None:
        by_identity = {_identity(row): row for row in known}
        self.first_of: dict[_Identity, ResultRow] = {}
        for row in rows:
            first = by_identity.get((row.run_id, row.experiment, row.baseline_case))
            if first is not None:
                self.first_of[_identity(row)] = first
        times = dict.fromkeys(RATIOS[VERDICTS.get(name, name)] for name in names if name in RATIOS or name in VERDICTS)
        contrasts: dict[tuple[_Identity, str], PairedContrast] = {}
        for row in rows:
            first = self.first_of.get(_identity(row))
            for time in times:
                contrast = None if first is None or self.is_first(row) else contrast_of(row, first, time)
                if contrast is not None:
                    contrasts[_identity(row), time] = contrast
        self._found = dict(zip(contrasts, judge(list(contrasts.values())), strict=True))
        self.in_one_process = sum(len(set(contrast.processes)) < 2 for contrast in contrasts.values())

    def __bool__(self) -> bool:
        """Return whether any case was judged."""
        return bool(self._found)

    def is_first(self, row: ResultRow) -> bool:
        """Return whether others are compared with this case."""
        return row.baseline_case == row.case_key != ""

    def of(self, row: ResultRow, name: str) -> Judgement | None:
        """Return the judgement behind a ratio or verdict of a case."""
        return self._found.get((_identity(row), RATIOS[VERDICTS.get(name, name)]))

    def firsts(self) -> list[ResultRow]:
        """Return the cases that others were compared with."""
        return list({_identity(first): first for first in self.first_of.values()}.values())

    def notes(self) -> list[str]:
        """Return what must be said of the ratios below a table."""
        if not self:
            return []
        said = ["ratios: by round, to the first case of each comparison; 95 % intervals, corrected over the table"]
        if self.in_one_process:
            said.append(
                f"{self.in_one_process} of {len(self._found)} ratios are from one process a case, for whose layout in"
                f" memory {LAYOUT_SHIFT:.0%} are allowed; a larger --budget divides the rounds among several"
            )
        return said


def _identity(row: ResultRow) -> _Identity:
    return row.run_id, row.experiment, row.case_key
