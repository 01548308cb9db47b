"""The account of one receiver: each caster that has it in its shadow volume, its maps' depths, the light it leaves."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from shadowbench.account import Account, Quantity, Step, Table, Value, number
from shadowbench.device.launch import Context, launch
from shadowbench.methods.instanced import account_kernels, kernels
from shadowbench.receivers import Receivers

if TYPE_CHECKING:
    from shadowbench.device.bounding_volumes import BoundingVolumes
    from shadowbench.methods.instanced.kernels import CasterMaps

MOST_LISTED = 24
"""Casters that an account lists."""

_TELLING = {
    id(kernels.one_map_to_all): account_kernels.tell_by_one_map,
    id(kernels.depths_to_all): account_kernels.tell_by_depth,
    id(kernels.results_to_all): account_kernels.tell_by_result,
    id(kernels.spot_to_all): account_kernels.tell_by_spot,
    id(kernels.faces_to_all): account_kernels.tell_by_cube_face,
}
"""By the kernel that applies all maps with the same look-up."""

_TESTS = ("outside the outline", "in front of a leading plane", "in front of another plane", "candidate")

_COMPARED: dict[int, str] = {
    id(kernels.depths_to_all): "shadowed where the depths behind, times share and depth range, add up to more than 0",
    id(kernels.results_to_all): "each map that it is behind takes its share",
}


def account_of(
    receiver: Receivers,
    maps: CasterMaps,
    volumes: BoundingVolumes | None,
    to_all: wp.Kernel,
    *,
    is_by_channel: bool,
    skips_other_test: bool,
    context: Context,
) -> Account:
    """Return the account of one receiver.

    Args:
        receiver: One receiver.
        maps: All maps, as look-ups take them.
        volumes: Outlined for the picture; ``None`` where all maps are asked.
        to_all: The kernel that applies all maps, by which the kind of look-up is known.
        is_by_channel: Whether visibility has three channels.
        skips_other_test: Look up what passed the first test.
        context: Where to run.
    """
    device, count = context.device, int(maps.transmittance.shape[0])
    share = wp.empty(count, dtype=wp.float32, device=device)
    views = wp.empty((count, 2), dtype=account_kernels.View, device=device)
    position = receiver.on(device).position
    launch(_TELLING[id(to_all)], count, inputs=[maps, position], outputs=[share, views], context=context)
    passed = np.full(count, 3)
    if volumes is not None:
        passed = _passed(receiver, volumes, position, count, context)
    is_asked = passed >= (2 if skips_other_test else 3)

    left: NDArray[np.float32] = np.ones(3 if is_by_channel else 1, np.float32)
    transmittance, shares, one = maps.transmittance.numpy(), share.numpy(), np.float32(1.0)
    for c in np.flatnonzero(is_asked & (shares < 1.0)):
        # what dim() does, channel by channel, in the casters' order
        left = left * (shares[c] + (one - shares[c]) * transmittance[c][: len(left)])
    channels = tuple(float(channel) for channel in left)

    order = np.argsort(~is_asked * 2 + (shares >= 1.0), kind="stable")
    listed = order[np.isin(order, np.flatnonzero(passed > 0))][:MOST_LISTED]
    rows = tuple(row for c in listed for row in _rows(int(c), maps, views.numpy()[c], passed, shares))
    columns = ("caster", "volume", "map", "share", "x", "y", "depth", "behind the texel by", "light left")
    quantities = (
        Quantity("casters", count),
        Quantity("casters whose outline covers it", int((passed > 0).sum())),
        Quantity("casters looked up", int(is_asked.sum())),
        Quantity("casters that take light", int((is_asked & (shares < 1.0)).sum())),
    )
    compared = _COMPARED.get(id(to_all), "shadowed where the receiver is behind its texel's depth")
    formula = (
        compared,
        f"visibility = product of the light left by the casters looked up = {', '.join(map(number, channels))}",
    )
    step = Step("maps of the casters", quantities, formula, Table("casters and their maps", columns, rows))
    return Account((step,), channels if is_by_channel else channels[0])


def _passed(
    receiver: Receivers, volumes: BoundingVolumes, position: wp.array[Any], count: int, context: Context
) -> NDArray[np.int32]:
    passed = wp.empty(count, dtype=wp.int32, device=context.device)
    row, column = divmod(int(receiver.pixel[0]), receiver.width)
    inputs = [
        volumes.planes.flatten(),
        volumes.plane_counts,
        volumes.lines,
        volumes.line_counts,
        volumes.rows,
        receiver.width,
        row,
        column,
        position,
    ]
    launch(account_kernels.tell_candidates, count, inputs=inputs, outputs=[passed], context=context)
    found: NDArray[np.int32] = passed.numpy()
    return found


def _rows(
    c: int, maps: CasterMaps, views: NDArray[Any], passed: NDArray[np.integer], shares: NDArray[np.float32]
) -> list[tuple[Value, ...]]:
    """Return a line for each map that a caster is looked up in."""
    place, share = maps.place.numpy(), maps.share.numpy()
    rows: list[tuple[Value, ...]] = []
    seen: set[int] = set()
    as_text: Callable[[float], Value] = lambda behind: "empty" if behind < -1.0e299 else float(behind)  # noqa: E731
    for view in views:
        at = int(view["number"])
        if at in seen or place[at][1] == 0:
            continue
        seen.add(at)
        numbers = (float(share[at]), float(view["x"]), float(view["y"]), float(view["depth"]))
        rows.append((c, _TESTS[int(passed[c])], at, *numbers, as_text(float(view["behind"])), float(shares[c])))
    return rows
