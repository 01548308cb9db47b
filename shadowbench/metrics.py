"""The quality measures: what each one counts, and over which receivers.

Everything here is NumPy on per-receiver arrays, so that a measure can be computed again from kept results. A receiver
is **scored** if it is valid, inside the light's field of view and turned to the light; a surface turned away is in
shadow by definition and counted apart. Counts stand beside percentages.

*False lit*: the reference is shadowed and the visibility is ½ or more. *False shadow*: the reference is lit and the
visibility is below ½. With coloured visibility the channel with the largest error decides.

Failures are counted against the hard reference, whatever the technique. Measures of degree (RMSE, SSIM, FLIP, leaks)
are against the reference that the technique aims at: a filtering one's is the truth filtered with its kernel, any
other's the hard truth.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from shadowbench.likeness import likeness, root_mean_square
from shadowbench.receivers import Receivers

if TYPE_CHECKING:
    from shadowbench.filtered_reference import FilteredReference
    from shadowbench.reference import Reference
    from shadowbench.world import World

METRIC_VERSION = 3
"""Raised whenever a measure changes, or the pictures of a row show something else or more, so that stored rows of the
old definition are neither mixed with new ones nor taken over by them."""

EDGE_RADIUS = 2
"""The edge band is every pixel within this many pixels (rows and columns) of a reference shadow edge."""

CONTACT_DISTANCE = 0.02
"""A blocker is *near*, for peter-panning, if it is closer than this share of the world's diagonal."""

Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class Measure:
    """What a quality column means.

    Attributes:
        title: For headings.
        unit: ``%`` or ``1``.
        better: Which direction is good.
        meaning: One sentence.
    """

    title: str
    unit: str
    better: str
    meaning: str


MEASURES: dict[str, Measure] = {
    "failure_percent": Measure("failure", "%", "lower", "Scored receivers on the wrong side of ½."),
    "false_lit_percent": Measure("false lit", "%", "lower", "Scored receivers shown lit that are in shadow."),
    "false_shadow_percent": Measure("false shadow", "%", "lower", "Scored receivers shown in shadow that are lit."),
    "acne_percent": Measure("acne", "%", "lower", "False shadow outside the edge band: a surface shadowing itself."),
    "peter_panning_percent": Measure(
        "peter-panning", "%", "lower", "False lit outside the edge band where the blocker is near: a detached shadow."
    ),
    "edge_band_percent": Measure("edge band", "%", "lower", "Failures among the scored receivers of the edge band."),
    "interior_percent": Measure("interior", "%", "lower", "Failures among the scored receivers outside the edge band."),
    "classified_percent": Measure("classified", "%", "lower", "Pixels that the method's own test calls failures."),
    "turned_away_percent": Measure(
        "turned away", "%", "lower", "Receivers shown lit among those turned away from the light (not scored)."
    ),
    "rmse": Measure("RMSE", "1", "lower", "Root mean square difference from the reference that the method aims at."),
    "edge_band_rmse": Measure("edge band RMSE", "1", "lower", "The same within the edge band and the penumbra."),
    "interior_rmse": Measure("interior RMSE", "1", "lower", "The same outside the edge band and the penumbra."),
    "ssim": Measure("SSIM", "1", "higher", "Structural similarity of the pictures of visibility."),
    "flip": Measure("FLIP", "1", "lower", "Difference that is seen between the pictures of visibility, in turn."),
    "leak_mean": Measure("leak", "1", "lower", "Mean visibility where the reference that the method aims at is 0."),
    "leak_p99": Measure("leak, 99th percentile", "1", "lower", "What a hundredth of those receivers exceed."),
    "approximation_rmse": Measure(
        "approximation RMSE", "1", "lower", "Difference from the mean of depth tests on the method's own map."
    ),
    "discretisation_rmse": Measure(
        "discretisation RMSE", "1", "lower", "Difference of that mean from the filtered reference: the texels' share."
    ),
    "reference_error": Measure("reference error", "1", "lower", "The filtered reference's own convergence error."),
}


@dataclass(frozen=True, eq=False)
class Measurement:
    """The measures of one result.

    Attributes:
        columns: Values by column name of :class:`shadowbench.rows.ResultRow`; ``None`` where nothing was scored.
        masks: The receivers behind each count, bool, shape [receiver_count].
    """

    columns: dict[str, Any]
    masks: dict[str, Mask]


def measure(
    world: World, receivers: Receivers, reference: Reference, visibility: NDArray[np.float32], masks: dict[str, Mask]
) -> Measurement:
    """Compare a visibility with the hard reference.

    Args:
        world: Gives the length by which a blocker is near.
        receivers: The visible samples.
        reference: Their exact visibility, blocker distances and classes.
        visibility: A method's result, shape [n] or [n, 3].
        masks: The method's own masks; ``classified`` is counted.
    """
    scored = receivers.valid & reference.in_field & ~reference.turned_away
    false_lit, false_shadow = failures(reference.visibility, visibility)
    false_lit, false_shadow = false_lit & scored, false_shadow & scored
    failed = false_lit | false_shadow
    band = edge_band(receivers, reference.visibility, scored)
    near = reference.blocker_distance < CONTACT_DISTANCE * world.diagonal()
    turned_away = receivers.valid & reference.in_field & reference.turned_away

    found: dict[str, Mask] = {
        "false_lit": false_lit,
        "false_shadow": false_shadow,
        "failure": failed,
        "acne": false_shadow & ~band,
        "peter_panning": false_lit & ~band & near,
        "edge_band": failed & band,
        "interior": failed & ~band,
        "turned_away": turned_away & (_channels(visibility).max(axis=1) >= 0.5),
    }
    among = {"edge_band": scored & band, "interior": scored & ~band, "turned_away": turned_away}
    columns: dict[str, Any] = {"receivers": len(receivers), "scored": int(scored.sum())}
    for name, mask in found.items():
        columns |= _share(name, mask, int(among.get(name, scored).sum()))
    if "classified" in masks:
        found["classified"] = masks["classified"]
        seen = np.zeros(receivers.width * receivers.height, dtype=bool)
        seen[receivers.pixel[masks["classified"]]] = True
        columns |= _share("classified", seen, len(seen))
    return Measurement(columns, found)


def measure_likeness(
    receivers: Receivers,
    reference: Reference,
    visibility: NDArray[np.float32],
    *,
    filtered: FilteredReference | None = None,
    on_map: NDArray[np.float32] | None = None,
) -> dict[str, Any]:
    """Compare a visibility with the reference that its technique aims at.

    Args:
        receivers: The visible samples.
        reference: Their hard reference.
        visibility: A method's result, shape [n] or [n, 3].
        filtered: The reference of a filtering method.
        on_map: The mean of depth tests on the method's own map, where it has one, shape [n].

    Returns:
        Values by column of :class:`shadowbench.rows.ResultRow`; ``None`` where nothing was scored or does not apply.
    """
    scored = receivers.valid & reference.in_field & ~reference.turned_away
    aim = reference.visibility if filtered is None else filtered.visibility
    band = edge_band(receivers, reference.visibility, scored)
    if filtered is not None:
        between = _channels(aim)
        band |= ((between > 0.0) & (between < 1.0)).any(axis=1)
    columns: dict[str, Any] = {
        **likeness(receivers, scored, aim, visibility),
        "edge_band_rmse": root_mean_square(visibility, aim, scored & band),
        "interior_rmse": root_mean_square(visibility, aim, scored & ~band),
    }
    if filtered is not None:
        columns["reference_error"] = filtered.error(scored)
    if filtered is not None and on_map is not None:
        columns["approximation_rmse"] = root_mean_square(visibility, on_map, scored)
        columns["discretisation_rmse"] = root_mean_square(on_map, aim, scored)
    return columns


def failures(reference: NDArray[np.float32], visibility: NDArray[np.float32]) -> tuple[Mask, Mask]:
    """Return (false lit, false shadow) per receiver; arguments of shape [n] or [n, 3]."""
    error = _channels(visibility) - _channels(reference)
    worst = np.take_along_axis(error, np.abs(error).argmax(axis=1)[:, None], axis=1)[:, 0]
    return worst >= 0.5, worst < -0.5


def _channels(values: NDArray[np.float32]) -> NDArray[np.float32]:
    return values.reshape(len(values), -1)


def _share(name: str, mask: Mask, among: int) -> dict[str, Any]:
    if among == 0:
        return {f"{name}_percent": None, f"{name}_count": None}
    count = int(mask.sum())
    return {f"{name}_percent": 100.0 * count / among, f"{name}_count": count}


def edge_band(receivers: Receivers, reference: NDArray[np.float32], scored: Mask, radius: int = EDGE_RADIUS) -> Mask:
    """Return which receivers lie within ``radius`` pixels of a reference shadow edge.

    An edge runs between two pixels side by side, or one above the other, of which one holds a scored lit receiver and
    the other a scored shadowed one (and through a pixel that holds both). Both pixels belong to it.

    Args:
        receivers: Where the receivers are in the picture.
        reference: Exact visibility, shape [n] or [n, 3]; below ½ in any channel is shadowed.
        scored: Which receivers count, shape [n].
        radius: [pixels], 0 for the edge's own pixels.
    """
    lit_here = _channels(reference).min(axis=1) >= 0.5
    lit = _any_in_pixel(receivers, scored & lit_here)
    dark = _any_in_pixel(receivers, scored & ~lit_here)
    edge = lit & dark
    for axis in (0, 1):
        before, after = _neighbours(axis)
        across = (lit[before] & dark[after]) | (dark[before] & lit[after])
        edge[before] |= across
        edge[after] |= across
    for axis in (0, 1):
        grown = edge.copy()
        for step in range(1, radius + 1):
            before, after = _neighbours(axis, step)
            grown[before] |= edge[after]
            grown[after] |= edge[before]
        edge = grown
    return edge.reshape(-1)[receivers.pixel]


def _any_in_pixel(receivers: Receivers, mask: Mask) -> Mask:
    image = np.zeros(receivers.width * receivers.height, dtype=bool)
    image[receivers.pixel[mask]] = True
    return image.reshape(receivers.height, receivers.width)


def _neighbours(axis: int, step: int = 1) -> tuple[tuple[slice, ...], tuple[slice, ...]]:
    """Slices that pair each pixel with the one ``step`` further along ``axis``."""
    everything = slice(None)
    before, after = slice(None, -step), slice(step, None)
    return ((before, everything), (after, everything)) if axis == 0 else ((everything, before), (everything, after))
