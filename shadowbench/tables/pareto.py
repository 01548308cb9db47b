"""Cost against quality: which methods no other one beats on both, one front for each scene, light, camera and size.

Both figures count downwards: the smaller the better. A method *dominates* another that it is surely no worse than in
both and surely better than in one. What is sure is decided as everywhere: quality, counters and bytes are exact; of
two times from the same interleaved rounds the ratio's interval decides, of others their own intervals. So a method has
one of three standings: on the *front* (none is better in both by the measured values), *dominated* (some method
dominates it), or *open* (some method is better by the values, but the intervals do not tell them apart).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from enum import StrEnum

from shadowbench.errors import UsageError, did_you_mean
from shadowbench.rows import FRAME_RATES, LONG_FIELDS, Outcome, ResultRow
from shadowbench.tables.columns import ROW_COLUMNS, Scalar, value_of
from shadowbench.tables.labels import Labels
from shadowbench.tables.layout import SETTING
from shadowbench.tables.quantities import Quantity, is_time, quantity_of, ratio_of

__all__ = ["COST", "COSTS", "QUALITIES", "QUALITY", "Best", "Front", "FrontPoint", "Standing", "best_within", "fronts"]

COST, QUALITY = "dynamic_frame_ms", "failure_percent"

COSTS = (
    *("build_ms", "shade_ms", "camera_ms", "static_frame_ms", "dynamic_frame_ms"),
    *("bytes_kept", "peak_rss_bytes", "compile_ms"),
)
QUALITIES = (
    *(name for name in ROW_COLUMNS if name.endswith(("_percent", "_count"))),
    *("rmse", "edge_band_rmse", "interior_rmse", "flip", "leak_mean", "leak_p99", "approximation_rmse"),
)


class Standing(StrEnum):
    """Where a method stands among those of its view."""

    FRONT = "front"
    DOMINATED = "dominated"
    OPEN = "open"


@dataclass(frozen=True)
class FrontPoint:
    """A case in the plane of cost and quality.

    Attributes:
        label: The method, with the parameters that tell it from the front's others.
        row: Its row.
        cost, quality: In the units of the columns.
        standing: Where it stands.
        dominated_by: Labels of the methods that dominate it or, if it is open, may do so; the cheapest first.
    """

    label: str
    row: ResultRow
    cost: Quantity
    quality: Quantity
    standing: Standing
    dominated_by: tuple[str, ...]

    @property
    def case_key(self) -> str:
        """The case's key."""
        return self.row.case_key


@dataclass(frozen=True)
class Front:
    """The methods of one view.

    Attributes:
        scene: Label: the name, with the parameters that tell it from the other fronts' scenes.
        light, camera, width, height, pixel_samples, layers, device, threads: Of the view.
        cost, quality: Names of the columns.
        points: Every measured case that has both, the cheapest first.
        setting: All that its cases have in common, by column; of the scene the label.
    """

    scene: str
    light: str
    camera: str
    width: int
    height: int
    pixel_samples: int
    layers: int
    device: str
    threads: int
    cost: str
    quality: str
    points: tuple[FrontPoint, ...]
    setting: dict[str, Scalar] = field(default_factory=dict)


def fronts(rows: Sequence[ResultRow], cost: str = COST, quality: str = QUALITY) -> tuple[Front, ...]:
    """Return a front for every scene, light, camera and size in which any case has both figures.

    Args:
        rows: Rows of one run. A case that several experiments hold counts once.
        cost: A column of which less is better: a time, ``bytes_kept``, ``counters.NAME``.
        quality: A column of which less is better: ``failure_percent``, ``rmse``.

    Raises:
        UsageError: There is no such column, or more of it is better.
    """
    _check(cost, COSTS, "cost")
    _check(quality, QUALITIES, "quality")
    views: dict[tuple[object, ...], dict[str, ResultRow]] = {}
    for row in rows:
        if row.outcome is Outcome.OK and quantity_of(row, cost) and quantity_of(row, quality):
            views.setdefault(_view(row), {}).setdefault(row.case_key, row)
    scenes = Labels("scene", [row for found in views.values() for row in found.values()])
    return tuple(_front(list(found.values()), scenes, cost, quality) for found in views.values())


@dataclass(frozen=True)
class Best:
    """The best method of a view within a limit.

    Attributes:
        point: The best by its value; ``None`` where none is within.
        no_worse: Labels of others within the limit that are not surely worse.
    """

    point: FrontPoint | None
    no_worse: tuple[str, ...] = ()


def best_within(front: Front, *, cost: float | None = None, quality: float | None = None) -> Best:
    """Return the best method with a cost within a limit, or the cheapest with a quality within one.

    A time is within a limit if its whole interval is.

    Args:
        front: The view's methods.
        cost: Most that it may cost, in the column's unit.
        quality: Most that its failures may be, in the column's unit, where no cost is given.
    """
    if cost is not None:
        within = [point for point in front.points if point.cost.high <= cost]
        wanted = front.quality
    else:
        within = [point for point in front.points if quality is None or point.quality.high <= quality]
        wanted = front.cost
    if not within:
        return Best(None)
    # of equals the cheaper one: points are in that order
    best = min(within, key=lambda point: _value(point.row, wanted))
    others = [point for point in within if point is not best and not _surely_worse(point.row, best.row, wanted)]
    return Best(best, tuple(point.label for point in others))


def _surely_worse(row: ResultRow, than: ResultRow, name: str) -> bool:
    return _surely_less(than, row, name) if is_time(name) else _value(row, name) > _value(than, name)


def _check(name: str, known: Iterable[str], noun: str) -> None:
    owner, _, inner = name.partition(".")
    if name not in known and not (inner and owner in LONG_FIELDS[:3]):
        hint = "less must be better" if name in FRAME_RATES or name == "ssim" else did_you_mean(name, known, noun=noun)
        raise UsageError(f"the {noun} cannot be '{name}'; {hint}")


def _view(row: ResultRow) -> tuple[object, ...]:
    scene = (row.scene, repr(sorted(row.scene_parameters.items())))
    return (*scene, *(value_of(row, name) for name in SETTING if name != "scene"))


def _front(rows: Sequence[ResultRow], scenes: Labels, cost: str, quality: str) -> Front:
    methods = Labels("method", rows)
    ordered = sorted(rows, key=lambda row: (_value(row, cost), _value(row, quality)))
    points = tuple(_point(row, ordered, methods, cost, quality) for row in ordered)
    first = rows[0]
    setting = {name: value_of(first, name) for name in SETTING} | {"scene": scenes.of(first)}
    return Front(
        *(scenes.of(first), first.light, first.camera, first.width, first.height, first.pixel_samples, first.layers),
        *(first.device, first.threads, cost, quality, points, setting),
    )


def _point(row: ResultRow, others: Sequence[ResultRow], methods: Labels, cost: str, quality: str) -> FrontPoint:
    by_values = [other for other in others if _dominates_by_values(other, row, (cost, quality))]
    surely = [other for other in by_values if _dominates(other, row, (cost, quality))]
    standing = Standing.DOMINATED if surely else Standing.OPEN if by_values else Standing.FRONT
    found_cost, found_quality = quantity_of(row, cost), quantity_of(row, quality)
    assert found_cost is not None
    assert found_quality is not None
    dominated_by = tuple(methods.of(other) for other in (surely or by_values))
    return FrontPoint(methods.of(row), row, found_cost, found_quality, standing, dominated_by)


def _value(row: ResultRow, name: str) -> float:
    found = quantity_of(row, name)
    assert found is not None
    return found.value


def _dominates_by_values(row: ResultRow, other: ResultRow, names: tuple[str, str]) -> bool:
    pairs = [(_value(row, name), _value(other, name)) for name in names]
    return all(a <= b for a, b in pairs) and any(a < b for a, b in pairs)


def _dominates(row: ResultRow, other: ResultRow, names: tuple[str, str]) -> bool:
    """Return whether a case that is better by its values is surely so: no worse in both, better in one."""
    return all(_surely_less(row, other, name) for name in names if is_time(name)) and any(
        _value(row, name) < _value(other, name) for name in names
    )


def _surely_less(row: ResultRow, other: ResultRow, name: str) -> bool:
    ratio = ratio_of(row, name, other, name)
    return ratio is not None and ratio.high < 1.0
