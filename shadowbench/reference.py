"""Ray-traced ground truth: the exact hard visibility of every receiver.

The truth is asked of the *surface point itself*, with no offset (``self_hit`` = ``plane``). A receiver is

1. the stored float32 position, interpolated on its triangle: at most 1 ulp off the triangle's plane;
2. in shadow if the eye and the light lie on opposite sides of that triangle's plane (it is *turned away*);
3. otherwise in shadow if and only if some caster triangle is crossed by the ray from the point to the light (edges and
   vertices included), lies between the point and the light, and has its plane farther from the point than
   delta = 16 ulp of the scene's largest coordinate (2^-23 each).

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

import numpy as np
import warp as wp
from numpy.typing import NDArray

from shadowbench.device.arrays import as_warp
from shadowbench.device.launch import Context, launch, synchronize
from shadowbench.device.rays import find_nearest_blockers
from shadowbench.device.triangle_tree import TriangleTree
from shadowbench.device.visibility import light_point, plane_tolerance
from shadowbench.errors import SceneError
from shadowbench.light_space import is_in_field_of_view
from shadowbench.receivers import Receivers
from shadowbench.scene import Light
from shadowbench.world import Casters, World

SELF_HIT = "plane"
"""The rule of this module, as the row's ``self_hit`` column names it."""


@dataclass(frozen=True, eq=False)
class Reference:
    """Hard ground truth of a picture and a light.

    Attributes:
        visibility: 1 lit, 0 shadowed (also outside the light's field of view), float32, shape [n].
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
        SceneError: The light has an area, or a caster is translucent: neither has a hard shadow.
    """
    casters = world.casters
    if not casters.is_opaque:
        raise SceneError("the hard reference needs opaque casters, but an instance has a transmittance above 0")
    packed_light = light_point(light)
    tree = TriangleTree(casters.triangle_count, context)
    tree.build(casters)

    device, count = context.device, receivers.count
    in_field = is_in_field_of_view(light, receivers.position)
    on_device, triangles = receivers.on(device), world.on(device)
    turned_away = wp.empty(count, dtype=wp.uint8, device=device)
    blocker = wp.empty(count, dtype=wp.int32, device=device)
    distance = wp.empty(count, dtype=wp.float32, device=device)
    launch(
        find_nearest_blockers,
        count,
        inputs=[
            tree.packed(),
            packed_light,
            wp.vec3d(*receivers.eye),
            plane_tolerance(casters.scale),
            triangles.vertices,
            triangles.triangles,
            as_warp(in_field.view(np.uint8), wp.uint8, device),
            on_device.position,
            on_device.triangle,
        ],
        outputs=[turned_away, blocker, distance],
        context=context,
    )
    synchronize(context)

    is_away = turned_away.numpy().astype(bool)
    nearest = np.where(is_away, receivers.triangle, _in_world(casters, blocker.numpy()))
    return Reference(
        visibility=(in_field & (nearest < 0)).astype(np.float32),
        turned_away=is_away,
        in_field=in_field,
        blocker=nearest,
        blocker_distance=np.where(is_away, np.float32(0.0), distance.numpy()),
    )


def _in_world(casters: Casters, triangles: NDArray[np.int32]) -> NDArray[np.int32]:
    """Return world triangle numbers of caster triangles; -1 stays."""
    instance = np.searchsorted(casters.first_triangle, triangles, side="right") - 1
    offset = np.append(casters.world_triangle, 0)  # -1 stands before the first instance and takes the last entry
    return (triangles + offset[instance]).astype(np.int32)
