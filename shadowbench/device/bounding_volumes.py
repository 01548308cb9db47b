"""Bounding shadow volumes of boxes, rasterised over a picture: which receivers a caster may shadow.

A box's shadow volume is the box and all that it hides from the light, without end: a convex body, bounded by the box's
lit faces and by the planes through the light and the box's silhouette edges (Buntin & Stamminger 2007, section 5.3). A
receiver is a *candidate* if it lies within. What lies under the body's *outline* in the picture is drawn, row by row:
the faces turned to the eye cover each pixel of the outline exactly once, and so do those turned away from it, so that
the outline is filled instead of face after face. Only the part of the body is drawn that reaches through the bounds of
the world: there are no receivers beyond. Kernels: :mod:`shadowbench.device.bounding_volumes_kernels`.

Nothing that the exact predicate of :mod:`shadowbench.device.visibility` lets a caster shadow is left out:

* Boxes are grown by :data:`ROUNDING_ULPS`: a world vertex is its mesh's, moved and rounded.
* Outlines are grown by half a pixel and what float32 rounds a position by, so that samples anywhere in a pixel count.
* Lit faces move in a little for receivers: of a receiver less than delta (16 ulp) times the cosine to the light behind
  such a face, the ray to the light leaves the box before it can cross anything that is farther than delta from it, the
  least distance at which something shadows. Receivers *on* a lit face, such as all of a flat ground that casts, are
  thus no candidates of their own caster, unless the light grazes it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from shadowbench.device.arrays import as_warp
from shadowbench.device.bounding_volume_geometry import MOST_PLANES
from shadowbench.device.bounding_volumes_kernels import MOST_LINES, Boxes, Picture, outline_volumes
from shadowbench.device.launch import Context, launch, synchronize
from shadowbench.device.visibility import ULP, plane_tolerance
from shadowbench.light_space import Frame
from shadowbench.receivers import Receivers
from shadowbench.world import World

ROUNDING_ULPS = 2
"""A vertex of the world lies within half an ulp of the scene's largest coordinate, along each axis, of its exact place,
and a receiver within an ulp of its triangle."""

_NEAR_MISS = 1.0e-6
"""An eye this near to a volume is taken for inside, relative to the scene's largest coordinate."""

_SLACK = 1.0e-6
"""By how much a volume is drawn beyond the world's bounds, for rounding."""

_PROBES = 64
"""Receivers by which a picture's camera is recognised."""


@dataclass(frozen=True, eq=False)
class OrientedBoxes:
    """Boxes in the world, each the affine image of an axis-aligned one.

    Attributes:
        half: Half of each box's sides, in its own space, float64, shape [n, 3].
        world_from_box: Linear part, float64, shape [n, 3, 3].
        box_from_world: Its inverse.
        centre: World positions, float64, shape [n, 3].
    """

    half: NDArray[np.float64]
    world_from_box: NDArray[np.float64]
    box_from_world: NDArray[np.float64]
    centre: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.half)

    def reach(self) -> NDArray[np.float64]:
        """Return how far each box reaches from its centre along the axes of the world, shape [n, 3]."""
        extent = np.abs(self.world_from_box) * self.half[:, None, :]
        return extent[:, :, 0] + extent[:, :, 1] + extent[:, :, 2]


class BoundingVolumes:
    """The shadow volumes of boxes under one light.

    Args:
        boxes: At least one.
        light: Homogeneous: (x, y, z, 1) for a position, (x, y, z, 0) for a direction towards the light.
        world: What the receivers are on.
        context: Where to run.

    Attributes:
        planes: (n, d): ``n·p + d`` is the distance [scene units] of a point outside of a plane; wp.vec4d, shape
            [box, MOST_PLANES].
        plane_counts: Of each box, how many planes lead and how many there are, wp.vec2i.
        lines, line_counts: Outlines as :func:`shadowbench.device.bounding_volumes_kernels.span_of_row` takes them.
        rows: First and end row of each outline, wp.vec2i.
        areas: Pixels within each outline, about; float32.
    """

    def __init__(self, boxes: OrientedBoxes, light: tuple[float, ...], world: World, context: Context) -> None:
        self.context = context
        self._scale = world.scale
        self._boxes = _packed(boxes, np.array(light, dtype=np.float64), world, context.device)
        count, device = len(boxes), context.device
        self.planes: wp.array[Any] = wp.empty((count, MOST_PLANES), dtype=wp.vec4d, device=device)
        self.plane_counts: wp.array[Any] = wp.empty(count, dtype=wp.vec2i, device=device)
        self.lines: wp.array[Any] = wp.empty((count, MOST_LINES), dtype=wp.vec3d, device=device)
        self.line_counts: wp.array[Any] = wp.empty(count, dtype=wp.int32, device=device)
        self.rows: wp.array[Any] = wp.empty(count, dtype=wp.vec2i, device=device)
        self.areas: wp.array[Any] = wp.empty(count, dtype=wp.float32, device=device)

    def __len__(self) -> int:
        return int(self.rows.shape[0])

    def outline(self, receivers: Receivers, frame: Frame, *, exits_first: bool) -> None:
        """Find the planes in the order of the tests, and the outlines in a picture.

        Args:
            receivers: What the picture shows. If they were not seen through ``frame``, every outline is the whole
                picture: slower, but no candidate is lost.
            frame: The camera's.
            exits_first: Lead with the planes turned away from the eye (z-fail) instead of those turned to it (z-pass).
                Where the eye is inside a volume there is no entry, and the exits lead in any case.
        """
        launch(
            outline_volumes,
            len(self),
            inputs=[self._boxes, _picture(receivers, frame, self._scale), exits_first],
            outputs=[self.planes, self.plane_counts, self.lines, self.line_counts, self.rows, self.areas],
            context=self.context,
        )
        synchronize(self.context)

    def cuts(self, band_height: int, band_count: int) -> list[int]:
        """Return where to cut the picture's bands into blocks of about equal work, several a thread."""
        rows, areas = self.rows.numpy(), self.areas.numpy().astype(np.float64)
        change = np.zeros(band_count * band_height + 1)
        density = areas / np.maximum(1, rows[:, 1] - rows[:, 0])
        np.add.at(change, rows[:, 0], density)
        np.add.at(change, rows[:, 1], -density)
        by_row = np.cumsum(change)[:-1] + max(1.0, 0.1 * areas.sum() / len(change))
        work = np.cumsum(by_row.reshape(band_count, band_height).sum(axis=1))
        block_count = 8 * self.context.threads
        found = np.searchsorted(work, work[-1] * np.arange(1, block_count) / block_count) + 1
        return [int(cut) for cut in np.unique(found) if cut < band_count]


def _packed(boxes: OrientedBoxes, light: NDArray[np.float64], world: World, device: str) -> Boxes:
    to_box = boxes.box_from_world
    # how much a box coordinate changes over a distance in the world
    per_distance = np.sqrt((to_box * to_box).sum(axis=2))
    margin = ROUNDING_ULPS * ULP * world.scale * per_distance
    high = boxes.half + margin
    offset = light[:3] - light[3] * boxes.centre
    in_box = (to_box * offset[:, None, :]).sum(axis=2)

    # the least cosine between a face's normal, a row of box_from_world, and the direction to the light
    distance = np.sqrt((offset * offset).sum(axis=1))
    corner_distance = np.sqrt((boxes.reach() ** 2).sum(axis=1))
    farthest = distance + light[3] * corner_distance
    beyond = np.abs(in_box) - light[3] * boxes.half
    cosine = np.maximum(beyond, 0.0) / (per_distance * farthest[:, None])
    inset = np.maximum(plane_tolerance(world.scale) * cosine * per_distance, 0.0) - margin

    def vectors(values: NDArray[np.float64]) -> wp.array[Any]:
        return as_warp(values, wp.vec3d, device)

    packed = Boxes()
    packed.low, packed.high = vectors(-high), vectors(high)
    packed.lit_low, packed.lit_high = vectors(inset - boxes.half), vectors(boxes.half - inset)
    nearest = (np.abs(in_box) - boxes.half * light[3]) / per_distance
    packed.reach = as_warp(_reach(boxes, light, nearest.max(axis=1), world), wp.float64, device)
    packed.origin = vectors(boxes.centre)
    packed.box_from_world = as_warp(to_box, wp.mat33d, device)
    in_space = np.concatenate([in_box, np.full((len(boxes), 1), light[3])], axis=1)
    packed.light = as_warp(in_space, wp.vec4d, device)
    return packed


def _reach(
    boxes: OrientedBoxes, light: NDArray[np.float64], nearest: NDArray[np.float64], world: World
) -> NDArray[np.float64]:
    """Return after how many steps away from the light, as long as the way from it, all of a box is out of the world.

    Args:
        boxes: The boxes.
        light: Homogeneous.
        nearest: Distance at least so far from the light to each box; for a direction, its length.
        world: Gives the bounds.
    """
    rounding = ROUNDING_ULPS * ULP * world.scale
    low, high = (
        bound.astype(np.float64) + side * rounding for bound, side in zip(world.bounds(), (-1, 1), strict=True)
    )
    extent = boxes.reach()
    nearer, farther = boxes.centre - extent, boxes.centre + extent
    steps = np.full(len(boxes), np.inf)
    with np.errstate(divide="ignore", invalid="ignore"):
        for axis in range(3):
            # the last to leave is what is nearest to the light; where that is on both sides nobody leaves for certain
            up, down = (side[:, axis] * light[3] - light[axis] for side in (nearer, farther))
            leaves_high = np.where(up > 0.0, (high[axis] - nearer[:, axis]) / up, np.inf)
            leaves_low = np.where(down < 0.0, (low[axis] - farther[:, axis]) / down, np.inf)
            steps = np.minimum(steps, np.minimum(leaves_high, leaves_low))
        length = np.sqrt(((high - low) ** 2).sum())
        if light[3] == 0.0:
            nearest = np.full(len(boxes), np.sqrt((light[:3] ** 2).sum()))
        near_miss = _NEAR_MISS * world.scale * light[3]
        steps = np.minimum(steps, np.where(nearest > near_miss, length / nearest, np.inf))
    return np.maximum(steps, 0.0) * (1.0 + _SLACK) + _SLACK


def _picture(receivers: Receivers, frame: Frame, scale: float) -> Picture:
    right, down, forward = frame.axes
    half_width, half_height = frame.extent[0] / 2.0, frame.extent[1] / 2.0
    per_pixel = max(frame.extent[0] / receivers.width, frame.extent[1] / receivers.height)
    picture = Picture()
    picture.eye = wp.vec3d(*receivers.eye)
    picture.corner = wp.vec3d(*(forward - half_width * right - half_height * down))
    picture.per_column = wp.vec3d(*(frame.extent[0] / receivers.width * right))
    picture.per_row = wp.vec3d(*(frame.extent[1] / receivers.height * down))
    picture.width, picture.height = wp.int32(receivers.width), wp.int32(receivers.height)
    # nothing is nearer than the near plane, where a rounded position may be seen this many pixels off
    rounded_off = ROUNDING_ULPS * ULP * scale / ((frame.near or 1.0) * per_pixel)
    picture.reach = wp.float64(0.5 + 2.0 * rounded_off)
    picture.near_miss = wp.float64(_NEAR_MISS * scale)
    picture.is_unknown = wp.bool(not _are_seen_through(frame, receivers))
    return picture


def _are_seen_through(frame: Frame, receivers: Receivers) -> bool:
    """Return whether a few receivers lie in this frame where their pixels are."""
    if frame.near is None or len(receivers) == 0:
        return False
    probes = np.linspace(0, len(receivers) - 1, _PROBES).astype(np.int64)
    probes = probes[receivers.valid[probes]]  # others may have no surface point
    u, v, _, w = frame.project(receivers.position[probes]).T
    pixel = receivers.pixel[probes]
    across = np.abs(u * receivers.width - 0.5 - pixel % receivers.width)
    along = np.abs(v * receivers.height - 0.5 - pixel // receivers.width)
    return bool(((across < 1.0) & (along < 1.0) & (w > 0.0)).all())
