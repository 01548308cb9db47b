"""Accounts of look-ups into a light's depth maps: where a receiver is in its map, and what is stored around it.

What :class:`~shadowbench.depth_map_method.DepthMapMethod` and its subclasses tell alike. Everything is asked of the
functions that the look-ups themselves call (:mod:`shadowbench.device.account_kernels`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from shadowbench.account import Account, Quantity, Step, Table, number, plain
from shadowbench.device.account_kernels import MOST_LOOKED_UP, tell_depth_tests, tell_footprint, tell_place
from shadowbench.device.arrays import as_warp
from shadowbench.device.filtered_lookup import Sampling, pixel_points
from shadowbench.device.launch import Context, launch, synchronize
from shadowbench.device.mip_chains import MipChain
from shadowbench.device.shadow_lookup import LightMaps, MapPoint
from shadowbench.receivers import Receivers

MOST_SHOWN = 9
"""Width of the window of stored depths that is shown at most [texels]."""


@dataclass(frozen=True, eq=False)
class MapPlace:
    """One receiver in its map.

    Attributes:
        point: As look-ups see it, a Warp array of one :class:`MapPoint`.
        face: Which map.
        x, y: Position [texels].
        depth: Linear depth.
        slopes: Of the receiver's plane, along x and y [depth per texel].
        state: What is known without a look-up: 1 lit, 0 shadowed, -1 nothing.
    """

    point: wp.array[Any]
    face: int
    x: float
    y: float
    depth: float
    slopes: tuple[float, float]
    state: int


def place_in_map(
    lookup: LightMaps, receiver: Receivers, context: Context, *, normal_offset: float = 0.0, plane: float = 0.0
) -> MapPlace:
    """Place one receiver in the light's map, with the arguments of :func:`~.device.shadow_lookup.find_in_map`."""
    on_device = receiver.on(context.device)
    point = wp.zeros(1, dtype=MapPoint, device=context.device)
    inputs = [lookup, on_device.position, on_device.normal, normal_offset, plane]
    launch(tell_place, 1, inputs=inputs, outputs=[point], context=context)
    synchronize(context)
    found = point.numpy()[0]
    slopes = float(found["slope_x"]), float(found["slope_y"])
    x, y, depth = float(found["x"]), float(found["y"]), float(found["depth"])
    return MapPlace(point, int(found["face"]), x, y, depth, slopes, int(found["state"]))


def known_account(place: MapPlace) -> Account:
    """Return the account of a receiver that no texel is asked about."""
    why = "nearer to the light than the near plane: lit" if place.state else "outside the light's cone: shadowed"
    return Account((Step("known without a look-up", formula=(why,)),), float(place.state))


def place_step(place: MapPlace, resolution: int) -> Step:
    """Return the step that says where the receiver is in the map."""
    quantities = [
        Quantity("x", place.x, "texels"),
        Quantity("y", place.y, "texels"),
        Quantity("depth", place.depth, "depth"),
        Quantity("resolution", resolution, "texels"),
    ]
    if place.face:
        quantities.insert(0, Quantity("face", place.face))
    if any(place.slopes):
        quantities.append(Quantity("slopes of the receiver's plane", place.slopes, "depth per texel"))
    return Step("place in the light's map", tuple(quantities))


@dataclass(frozen=True, eq=False)
class DepthTests:
    """Depth tests of one receiver, one a texel.

    Attributes:
        texel: Column and row, int32, shape [n, 2].
        compared: The receiver's depth there, less the bias, float64.
        stored: What the texel holds, float32.
        is_lit: 1 or 0, float32.
    """

    texel: NDArray[np.int32]
    compared: NDArray[np.float64]
    stored: NDArray[np.float32]
    is_lit: NDArray[np.float32]

    def table(self, title: str, weights: NDArray[np.floating] | None = None) -> Table:
        """Return one line a test, with its weight where tests are weighed."""
        columns: tuple[str, ...] = ("column", "row", "compared depth", "stored depth", "difference", "lit")
        difference = self.compared - self.stored
        parts = [*self.texel.T, self.compared, self.stored.astype(np.float64), difference, self.is_lit]
        if weights is not None:
            columns, parts = (*columns, "weight"), [*parts, weights]
        rows = tuple(tuple(plain(part[k]) for part in parts) for k in range(len(self.texel)))
        return Table(title, columns, rows)


def depth_tests(
    lookup: LightMaps, point: wp.array[Any], texel: NDArray[np.integer], bias: float, context: Context
) -> DepthTests:
    """Test a receiver against some texels, shape [n, 2], from one :class:`MapPoint`, or from one for each texel."""
    count = len(texel)
    compared = wp.empty(count, dtype=wp.float64, device=context.device)
    stored, is_lit = (wp.empty(count, dtype=wp.float32, device=context.device) for _ in range(2))
    texels: NDArray[np.int32] = np.ascontiguousarray(texel, dtype=np.int32)
    inputs = [lookup, point, as_warp(texels, wp.vec2i, context.device), bias]
    launch(tell_depth_tests, count, inputs=inputs, outputs=[compared, stored, is_lit], context=context)
    synchronize(context)
    return DepthTests(texels, compared.numpy(), stored.numpy(), is_lit.numpy())


def stored_step(lookup: LightMaps, place: MapPlace, width: int, bias: float, context: Context) -> Step:
    """Return the step that shows the depths stored around the receiver, ``width`` texels wide or as many as are shown.

    The depths are those drawn, before any filter.
    """
    shown = min(max(width, 3), MOST_SHOWN) | 1
    column, row = int(np.floor(place.x)), int(np.floor(place.y))
    steps = np.arange(shown) - shown // 2
    texel = np.stack(np.meshgrid(column + steps, row + steps), axis=-1).reshape(-1, 2)
    tests = depth_tests(lookup, place.point, texel, bias, context)
    stored = tests.stored.reshape(shown, shown).astype(np.float64)
    lit = int(tests.is_lit.sum())
    rows = tuple((int(row + step), *plain(line)) for step, line in zip(steps, stored, strict=True))
    quantities = (
        Quantity("nearest stored", float(stored.min()), "depth"),
        Quantity("farthest stored", float(stored.max()), "depth"),
        Quantity("receiver", place.depth, "depth"),
        Quantity("tests that are lit", f"{lit} of {shown * shown}"),
    )
    title = f"stored depths around the receiver, {shown} x {shown} texels (1 where nothing was drawn)"
    return Step(title, quantities, table=Table("row of texels", ("row", *(str(c) for c in column + steps)), rows))


@dataclass(frozen=True, eq=False)
class LookedUp:
    """What a filtered look-up averages.

    Attributes:
        step: For the account.
        index: First value of each texel in the chain, int64, shape [n].
        weight: Of each texel, float64, shape [n]; they sum to 1.
        polygon_offset: That the map was drawn with at the receiver [depth].
    """

    step: Step
    index: NDArray[np.int64]
    weight: NDArray[np.float64]
    polygon_offset: float


def looked_up(
    lookup: LightMaps,
    receiver: Receivers,
    chain: MipChain,
    sampling: Sampling,
    slope_bias: float,
    names: Sequence[str],
    context: Context,
) -> LookedUp:
    """Tell what the look-up of one receiver averages.

    Args:
        lookup: The maps and the light.
        receiver: One receiver.
        chain: What is looked up.
        sampling: How.
        slope_bias: Polygon offset's factor.
        names: Of the channels that are shown.
        context: Where to run.
    """
    shape = wp.zeros(8, dtype=wp.float64, device=context.device)
    corners = wp.zeros((MOST_LOOKED_UP, 5), dtype=wp.int32, device=context.device)
    between = wp.zeros((MOST_LOOKED_UP, 2), dtype=wp.float32, device=context.device)
    points = pixel_points(receiver.on(context.device))
    inputs = [lookup, points, chain.layout, sampling, slope_bias]
    launch(tell_footprint, 1, inputs=inputs, outputs=[shape, corners, between], context=context)
    synchronize(context)
    x, y, step_x, step_y, taps, level, blend, polygon_offset = plain(shape.numpy())
    levels = 2 if blend > 0.0 else 1
    lines: list[tuple[Any, ...]] = []
    index, weight = [], []
    values = chain.values.numpy()
    for line in (2 * tap + finer for tap in range(int(taps)) for finer in range(levels)):
        right, down = (float(v) for v in between.numpy()[line])
        share = (1.0 if levels == 1 else (1.0 - blend, blend)[line % 2]) / taps
        for corner, part in enumerate(
            ((1.0 - right) * (1.0 - down), right * (1.0 - down), (1.0 - right) * down, right * down)
        ):
            if part == 0.0:
                continue
            at = int(corners.numpy()[line, 1 + corner])
            index.append(at)
            weight.append(share * part)
            held = values[at : at + len(names)]
            lines.append((line // 2, int(corners.numpy()[line, 0]), share * part, *plain(held)))
    quantities = (
        Quantity("first tap", (x, y), "texels"),
        Quantity("step from tap to tap", (step_x, step_y), "texels"),
        Quantity("taps", int(taps)),
        Quantity("level of detail", level + blend),
    )
    table = Table("texels averaged", ("tap", "level", "weight", *names), tuple(lines))
    formula = (f"{len(lines)} texels, the pixel's footprint in the map; level {number(level + blend)}",)
    step = Step("texels under the footprint", quantities, formula, table)
    return LookedUp(step, np.array(index, np.int64), np.array(weight), polygon_offset)
