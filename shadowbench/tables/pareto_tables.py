"""Fronts of cost against quality as tables: every method with its standing, and the best within a limit.

These are :class:`~shadowbench.tables.table.Table` like all others, so every format writes them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from shadowbench.rows import ResultRow, RunRecord
from shadowbench.tables.columns import header_text, header_unit, unit_of
from shadowbench.tables.layout import SETTING
from shadowbench.tables.numbers import MEBIBYTE, number_text
from shadowbench.tables.pareto import COST, QUALITY, Best, Front, FrontPoint, Standing, best_within, fronts
from shadowbench.tables.quantities import Quantity
from shadowbench.tables.table import Cell, Header, Table

_ALWAYS = ("scene", "light", "camera", "size")

_STANDINGS = (
    "front: no method is better in both",
    "dominated: some method is surely no worse in both and surely better in one",
    "open: some method is better by the values, but the intervals do not tell them apart",
)


@dataclass(frozen=True)
class Limits:
    """What the best methods are looked for within.

    Attributes:
        milliseconds, mebibytes: Most that a method may cost: a time, and ``bytes_kept``.
        percent: Most of the receivers that may fail.
    """

    milliseconds: float | None = None
    mebibytes: float | None = None
    percent: float | None = None

    @property
    def are_given(self) -> bool:
        """Whether there is any."""
        return not (self.milliseconds is self.mebibytes is self.percent is None)


def pareto_tables(
    rows: Sequence[ResultRow],
    run: RunRecord,
    *,
    cost: str = COST,
    quality: str = QUALITY,
    limits: Limits | None = None,
) -> list[Table]:
    """Return for each experiment the table of its fronts, or where limits are given one table for each.

    Args:
        rows: The run's rows.
        run: The run.
        cost, quality: Columns; see :func:`~shadowbench.tables.pareto.fronts`. The limit in milliseconds is of ``cost``
            if that is a time and of ``dynamic_frame_ms`` else, that in mebibytes of ``bytes_kept``, and that in percent
            of ``quality`` if that is a percentage and of ``failure_percent`` else.
        limits: The limits.

    Raises:
        UsageError: A column cannot be a cost or a quality.
    """
    titles = {str(d.get("name")): str(d.get("title") or d.get("name")) for d in run.definitions}
    counts = {str(d.get("name")): d.get("case_count") for d in run.definitions}
    tables = []
    for name in dict.fromkeys((*run.experiments, *(row.experiment for row in rows))):
        own = [row for row in rows if row.experiment == name]
        missing = f" (partial: {len(own)} of {counts.get(name)} cases)" if len(own) < (counts.get(name) or 0) else ""
        maker = _Maker(own, run, name, titles.get(name, name), missing)
        if limits is None or not limits.are_given:
            tables.append(maker.front_table(cost, quality))
        else:
            tables += maker.limit_tables(cost, quality, limits)
    return tables


@dataclass(frozen=True)
class _Maker:
    rows: Sequence[ResultRow]
    run: RunRecord
    experiment: str
    title: str
    missing: str

    def front_table(self, cost: str, quality: str) -> Table:
        found = fronts(self.rows, cost, quality)
        places = _places(found)
        body = [
            (*_place_cells(front, places), Cell(point.label), *_point_cells(front, point), *_standing_cells(point))
            for front in found
            for point in front.points
        ]
        headers = (_header(cost), _header(quality), _text_header("standing"), _text_header("dominated by"))
        title = f"{header_text(cost)} against {header_text(quality)}"
        return self.table(title, (*places, "method"), headers, body, _STANDINGS)

    def limit_tables(self, cost: str, quality: str, limits: Limits) -> list[Table]:
        time = cost if unit_of(cost) == "ms" else COST
        share = quality if unit_of(quality) == "%" else QUALITY
        tables = []
        if limits.milliseconds is not None:
            title = f"least {header_text(quality)} within {limits.milliseconds:g} ms of {header_text(time)}"
            found = [(f, best_within(f, cost=limits.milliseconds)) for f in fronts(self.rows, time, quality)]
            tables.append(self.best_table(title, time, quality, found))
        if limits.mebibytes is not None:
            title = f"least {header_text(quality)} within {limits.mebibytes:g} MiB kept"
            allowed = limits.mebibytes * MEBIBYTE
            found = [(f, best_within(f, cost=allowed)) for f in fronts(self.rows, "bytes_kept", quality)]
            tables.append(self.best_table(title, "bytes_kept", quality, found))
        if limits.percent is not None:
            title = f"least {header_text(cost)} within {number_text(limits.percent, '%')} % of {header_text(share)}"
            found = [(f, best_within(f, quality=limits.percent)) for f in fronts(self.rows, cost, share)]
            tables.append(self.best_table(title, cost, share, found))
        return tables

    def best_table(self, title: str, cost: str, quality: str, found: Sequence[tuple[Front, Best]]) -> Table:
        places = _places([front for front, _ in found])
        body = [
            (
                *_place_cells(front, places),
                Cell(best.point.label if best.point is not None else "none"),
                *(_point_cells(front, best.point) if best.point is not None else (Cell(), Cell())),
                Cell("; ".join(best.no_worse) or None),
            )
            for front, best in found
        ]
        headers = (_header(cost), _header(quality), _text_header("no worse"))
        notes = ("a time is within a limit if its interval is",) if unit_of(cost) == "ms" else ()
        return self.table(title, (*places, "method"), headers, body, notes)

    def table(
        self,
        title: str,
        index: Sequence[str],
        values: tuple[Header, ...],
        body: Sequence[tuple[Cell, ...]],
        notes: tuple[str, ...],
    ) -> Table:
        unmeasured = sum(row.outcome.is_failure for row in self.rows)
        if unmeasured:
            notes = (*notes, f"left out: {unmeasured} case{'s' if unmeasured > 1 else ''} that failed")
        if not body:
            notes = (*notes, "no measured case has both figures")
        return Table(
            title=f"{self.title}: {title}{self.missing}",
            experiment=self.experiment,
            run_id=self.run.run_id,
            index=tuple(Header(name, name, header_text(name), header_unit(name)) for name in index),
            values=values,
            body=tuple(body),
            notes=notes,
            rows=tuple(self.rows),
        )


def _places(found: Sequence[Front]) -> tuple[str, ...]:
    """Return the columns that name a view: the usual ones, and others that tell two fronts apart."""
    return tuple(name for name in SETTING if name in _ALWAYS or len({front.setting[name] for front in found}) > 1)


def _place_cells(front: Front, places: Sequence[str]) -> tuple[Cell, ...]:
    return tuple(Cell(front.setting[name]) for name in places)


def _point_cells(front: Front, point: FrontPoint) -> tuple[Cell, Cell]:
    return _cell(point.cost, front.cost), _cell(point.quality, front.quality)


def _cell(quantity: Quantity, name: str) -> Cell:
    unit = unit_of(name)
    value = int(quantity.value) if quantity.value.is_integer() and unit not in ("ms", "%", "1") else quantity.value
    interval = None if quantity.is_exact or quantity.high == float("inf") else (quantity.low, quantity.high)
    return Cell(value, unit, interval)


def _standing_cells(point: FrontPoint) -> tuple[Cell, Cell]:
    shown = {Standing.FRONT: "\u25cf front", Standing.OPEN: "\u25cb open", Standing.DOMINATED: "dominated"}
    return Cell(point.standing.value, shown=shown[point.standing]), Cell(_named(point.dominated_by))


def _named(labels: Sequence[str]) -> str | None:
    more = f" and {len(labels) - 1} more" if len(labels) > 1 else ""
    return f"{labels[0]}{more}" if labels else None


def _header(name: str) -> Header:
    return Header(name, name, header_text(name), header_unit(name))


def _text_header(text: str) -> Header:
    return Header("", text.replace(" ", "_"), text)
