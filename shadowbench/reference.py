"""Ray-traced ground truth: the exact hard visibility of every receiver.

The truth is asked of the *surface point itself*, with no offset (``self_hit`` = ``plane``). A receiver is

1. the stored float32 position, interpolated on its triangle: at most 1 ulp off the triangle's plane;
2. in shadow if the eye and the light lie on opposite sides of that triangle's plane (it is *turned away*);
3. otherwise in shadow if and only if some caster triangle is crossed by the ray from the point to the light (edges and
   vertices included), lies between the point and the light, and has its plane farther from the point than
   delta = 16 ulp of the scene's largest coordinate (2^-23 each).

A translucent caster dims instead: the light is multiplied by its transmittance, channel by channel, once for each sheet
that the ray crosses (an edge or vertex between triangles of a sheet counts once).

Outside a spot light's cone nothing is lit, and nothing nearer to a light than its near plane casts.

All of it is decided in float64 on the float32 positions, by functions that exact methods share
(:mod:`shadowbench.device.visibility`), so that they can be compared with the truth bit for bit.

Why not the usual offset along the normal: that is another question. Among a million random triangles, offsets of 1e-5
and 1e-4 of the scene's diagonal change the answer at one receiver in forty and one in six. Leaving out the receiver's
own triangle fails at shared edges, at grazing light and on duplicated faces; leaving out hits nearer than some distance
*along the ray* fails at grazing light. Distance to the blocker's *plane* is right in all of these: the own surface, its
coplanar neighbours and its duplicates have the point in their plane, and what has the point in its plane cannot stand
in the way of a ray that leaves that plane.

Limits: two sheets closer than delta do not shadow each other; a scene far from the origin must be recentred, as
:func:`shadowbench.world.place` does, or delta grows with the distance.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from shadowbench.device.arrays import as_warp
from shadowbench.device.instance_forest import InstanceForest, tree_over
from shadowbench.device.instance_forest_kernels import find_nearest_blockers_in_forest
from shadowbench.device.launch import Context, launch, synchronize
from shadowbench.device.point_visibility import PointVisibility
from shadowbench.device.rays import find_nearest_blockers, find_turned_away
from shadowbench.device.translucency import trace_through
from shadowbench.device.triangle_tree import TriangleTree
from shadowbench.device.visibility import LightPoint, light_point, plane_tolerance
from shadowbench.errors import ShadowbenchError
from shadowbench.light_space import is_in_field_of_view
from shadowbench.receivers import Receivers
from shadowbench.scene import Light
from shadowbench.world import Casters, World

SELF_HIT = "plane"
"""The rule of this module, as the row's ``self_hit`` column names it."""

MANY = 1 << 22
"""From so many receivers on, visibility is rasterised at their places in light space, so many at a time, which gives
the same bits sooner (:mod:`shadowbench.device.point_visibility`)."""

CHECKED = 64
"""Of many lit receivers, one in so many is traced as well: the check of the rasteriser. Shadowed ones all are, since
only rays know their blockers."""


@dataclass(frozen=True, eq=False)
class Reference:
    """Hard ground truth of a picture and a light.

    Attributes:
        visibility: 1 lit, 0 shadowed (also outside the light's field of view), float32, shape [n]; where casters are
            translucent, the product of the transmittances of all crossings by channel, shape [n, 3].
        turned_away: Whether the receiver's own plane hides it (step 2), bool, shape [n].
        in_field: Whether the light reaches the receiver at all (:func:`shadowbench.light_space.is_in_field_of_view`),
            bool, shape [n].
        blocker: World triangle that the ray to the light crosses first, of equally near ones the lowest number; the
            receiver's own where turned away; -1 where nothing blocks; int32, shape [n].
        blocker_distance: Along that ray [scene units]: 0 where turned away, infinite where nothing blocks; float32,
            shape [n].
    """

    visibility: NDArray[np.float32]
    turned_away: NDArray[np.bool_]
    in_field: NDArray[np.bool_]
    blocker: NDArray[np.int32]
    blocker_distance: NDArray[np.float32]


def hard_reference(world: World, receivers: Receivers, light: Light, context: Context) -> Reference:
    """Decide every receiver, valid or not; the same bits for every number of threads.

    Args:
        world: The placed scene.
        receivers: Made of this world.
        light: One of the world's lights.
        context: Where to run.

    Raises:
        SceneError: The light has an area, so there is no hard shadow.
    """
    casters = world.casters
    packed_light = light_point(light)
    tree = tree_over(casters, context)
    tree.build(casters)
    in_field = is_in_field_of_view(light, receivers.position)
    is_away = in_field & _turned_away(world, receivers, packed_light, context)
    asked = in_field & ~is_away
    if receivers.count < MANY:
        nearest, distance = _nearest_blockers(tree, casters, packed_light, receivers, asked, context)
        visibility = (asked & (nearest < 0)).astype(np.float32)
        if not casters.is_opaque:
            visibility = _light_through(tree, casters, light, receivers, asked, context)
    else:
        visibility = _rasterized(casters, light, receivers, asked, context)
        # rays know blockers, so the shadowed receivers are traced; and some of the lit ones, to check the rasteriser
        is_dimmed: NDArray[np.bool_] = np.any(visibility.reshape(receivers.count, -1) < 1.0, axis=1)
        is_sample = asked & (np.arange(receivers.count) % CHECKED == 0)
        traced = asked & (is_dimmed | is_sample)
        nearest, distance = _nearest_blockers(tree, casters, packed_light, receivers, traced, context)
        if casters.is_opaque:
            _must_agree(is_dimmed[traced], nearest[traced] >= 0)
        else:
            through = _light_through(tree, casters, light, receivers, is_sample, context)
            _must_agree(visibility[is_sample], through[is_sample])
    blocker = _in_world(casters, nearest)
    return Reference(
        visibility=visibility,
        turned_away=is_away,
        in_field=in_field,
        blocker=np.where(is_away, receivers.triangle, blocker),
        blocker_distance=np.where(is_away, np.float32(0.0), distance),
    )


def _turned_away(world: World, receivers: Receivers, light: LightPoint, context: Context) -> NDArray[np.bool_]:
    on_device, lookup = receivers.on(context.device), world.lookup(context.device)
    turned_away = wp.empty(receivers.count, dtype=wp.uint8, device=context.device)
    eye = wp.vec3d(*receivers.eye)
    inputs = [light, eye, lookup, on_device.triangle]
    launch(find_turned_away, receivers.count, inputs=inputs, outputs=[turned_away], context=context)
    synchronize(context)
    found: NDArray[np.bool_] = turned_away.numpy().astype(bool)
    return found


def _nearest_blockers(
    tree: TriangleTree | InstanceForest,
    casters: Casters,
    light: LightPoint,
    receivers: Receivers,
    asked: NDArray[np.bool_],
    context: Context,
) -> tuple[NDArray[np.int32], NDArray[np.float32]]:
    """Return the caster triangle (-1 for none) that hides each receiver first, and its distance (infinite)."""
    blocker = wp.empty(receivers.count, dtype=wp.int32, device=context.device)
    distance = wp.empty(receivers.count, dtype=wp.float32, device=context.device)
    launch(
        find_nearest_blockers_in_forest if isinstance(tree, InstanceForest) else find_nearest_blockers,
        receivers.count,
        inputs=[
            tree.packed(),
            light,
            plane_tolerance(casters.scale),
            as_warp(asked.view(np.uint8), wp.uint8, context.device),
            receivers.on(context.device).position,
        ],
        outputs=[blocker, distance],
        context=context,
    )
    synchronize(context)
    return blocker.numpy(), distance.numpy()


def _light_through(
    tree: TriangleTree | InstanceForest,
    casters: Casters,
    light: Light,
    receivers: Receivers,
    asked: NDArray[np.bool_],
    context: Context,
) -> NDArray[np.float32]:
    """Return what translucent casters let through by channel, shape [n, 3], by rays."""
    visibility = wp.empty((receivers.count, 3), dtype=wp.float32, device=context.device)
    trace_through(
        tree,
        casters,
        light,
        asked=as_warp(asked.view(np.uint8), wp.uint8, context.device),
        position=receivers.on(context.device).position,
        visibility=visibility,
        context=context,
    )
    synchronize(context)
    through: NDArray[np.float32] = visibility.numpy()
    return through


def _rasterized(
    casters: Casters, light: Light, receivers: Receivers, asked: NDArray[np.bool_], context: Context
) -> NDArray[np.float32]:
    """Return the visibility of many receivers, shape [n], or [n, 3] through translucent casters, by rasterising."""
    engine = PointVisibility(casters, light, context)
    visibility = np.empty((receivers.count,) if casters.is_opaque else (receivers.count, 3), np.float32)
    position = receivers.on(context.device).position
    for begin in range(0, receivers.count, MANY):
        block = slice(begin, min(begin + MANY, receivers.count))
        found = wp.empty(visibility[block].shape, dtype=wp.float32, device=context.device)
        engine.ask(position[block], found)
        visibility[block] = found.numpy()
    visibility[~asked] = 0.0
    return visibility


def _must_agree(rasterized: NDArray[Any], traced: NDArray[Any]) -> None:
    if not np.array_equal(rasterized, traced):
        wrong = int(np.count_nonzero(np.any((rasterized != traced).reshape(len(traced), -1), axis=1)))
        raise ShadowbenchError(f"bug: the rasteriser and rays disagree at {wrong} of {len(traced)} receivers")


def _in_world(casters: Casters, triangles: NDArray[np.int32]) -> NDArray[np.int32]:
    """Return world triangle numbers of caster triangles; -1 stays."""
    instance = np.searchsorted(casters.first_triangle, triangles, side="right") - 1
    offset = np.append(casters.world_triangle, 0)  # -1 stands before the first instance and takes the last entry
    return (triangles + offset[instance]).astype(np.int32)
