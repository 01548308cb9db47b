"""Cost against quality of a view's cases: the plot of a :class:`~shadowbench.tables.pareto.Front`."""

from __future__ import annotations

import math
from collections.abc import Mapping

from shadowbench.report import wording
from shadowbench.report.chart import Axis, Plot, Point, Series
from shadowbench.tables.columns import header_text, header_unit
from shadowbench.tables.pareto import Front, FrontPoint, Standing

MOST_NAMED = 12
"""Labels beside points; of more, the rest are told when pointed at."""

_NAMES = {
    Standing.FRONT: "none is better in both",
    Standing.OPEN: "undecided: another may be better in both",
    Standing.DOMINATED: "dominated: another is better in both",
}
_STYLES = {Standing.FRONT: 0, Standing.OPEN: 1, Standing.DOMINATED: 7}


def pareto_plot(front: Front, title: str, names: Mapping[str, tuple[str, str]]) -> Plot | None:
    """Return the plot of a front, or ``None`` if it has fewer than two points.

    Args:
        front: A view's methods.
        title: The view.
        names: Case key -> label and anchor in the page.
    """
    if len(front.points) < 2:
        return None
    named = {point.case_key for point in front.points if point.standing is Standing.FRONT}
    for point in front.points:
        if len(named) < MOST_NAMED:
            named.add(point.case_key)
    series = []
    for standing, name in _NAMES.items():
        found = [point for point in front.points if point.standing is standing]
        if found:
            points = tuple(_point(point, names[point.case_key], is_named=point.case_key in named) for point in found)
            is_front = standing is Standing.FRONT
            series.append(Series(name, _STYLES[standing], points, is_line=is_front, is_faint=not is_front))
    best = [names[point.case_key][0] for point in front.points if point.standing is Standing.FRONT]
    return Plot(
        title=f"Cost against quality: {title}",
        x=Axis(f"{header_text(front.cost)} [{header_unit(front.cost)}]", is_log=True),
        y=Axis(f"{header_text(front.quality)} [{header_unit(front.quality)}]", is_log=True),
        series=tuple(series),
        summary=f"{len(front.points)} cases; on the front, the cheapest first: {', '.join(best)}.",
        notes=("down and to the left is better; whiskers are 95 % intervals; choose a point to open its case",),
    )


def _point(point: FrontPoint, name: tuple[str, str], *, is_named: bool) -> Point:
    label, anchor = name
    cost, quality = point.cost, point.quality
    told = f"{label}: {wording.milliseconds(cost.value)}, {wording.percent(quality.value)} failing"
    if point.dominated_by:
        verb = "dominated by" if point.standing is Standing.DOMINATED else "may be dominated by"
        told += f"; {verb} {', '.join(point.dominated_by[:3])}"
    left, right = (end if math.isfinite(end) else cost.value for end in (cost.low, cost.high))
    return Point(
        cost.value, quality.value, quality.low, quality.high, left, right, told, anchor, label if is_named else ""
    )
