"""Filtered ground truth: exact hard shadows, filtered with a technique's own kernel.

A technique that filters its map blurs shadow edges on purpose; against the hard truth, that would count as error.
The truth for it is percentage-closer filtering (Reeves, Salesin & Cook 1987) at infinite resolution: the mean of exact
hard tests over the kernel's footprint, weighted by the kernel. Here, for every receiver,

1. N points are spread over the footprint in the light's window, around the receiver, as densely as the kernel weighs
   (:func:`shadowbench.light_space_kernel.footprint_points`; N = 64 unless said otherwise, the same for all receivers);
2. each is carried along the light's ray through it onto the receiver's own plane: that through the stored position at
   right angles to the stored normal (*receiver-plane depth*: a plane never shadows itself, however wide the kernel);
3. each is asked with the exact predicate (:mod:`shadowbench.device.point_visibility`), and the plain mean is taken.

A point of the plane may lie inside other geometry, where the surface has left the plane: it is then in shadow, as the
definition says.

What else can happen to a point:

* *The plane is seen nearly edge-on from the light.* Its footprint is stretched without bound. Points move along their
  ray no farther than the world reaches (its diagonal, or its corner farthest from a positional light, and a tenth
  more): beyond lies no caster, and so the clamp changes no answer.
* *The ray meets the plane behind a positional light*, or never: beyond the plane's horizon. The point is taken at that
  farthest distance too, as those of rays just inside the horizon are.
* *The point leaves the light's window.* The border of a window is not an edge of anything, so points beyond it are
  asked like others: around a point light they fall into the neighbouring face; under a spot light the cone is widened
  for them, so that the cone's outline is not blurred, which no map blurs either. (Beyond 170 degrees, where no cone can
  follow, they stay at the border.)
* *The receiver is turned away from the light or outside its field.* It is in shadow, as in the hard truth; nothing is
  asked.

Translucent casters dim: the mean is one of products of transmittances, by channel.

**Convergence.** The error of the mean falls about as N^-0.7 where a straight edge crosses the footprint, and is 0 where
no edge does. Its estimate is half the difference between the means over the first and the second half of the points,
which are two evenly spread sets of N/2 that share no point; from 64 points on, its root mean square over many receivers
is 1.2 to 1.6 times the true one: it errs on the safe side. For N = 64, receivers with a straight edge in their
footprint are off by 0.013 (root mean square).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from shadowbench.device.arrays import as_warp
from shadowbench.device.footprint_kernels import LightRays, average_halves, spread_points
from shadowbench.device.launch import Context, launch, synchronize
from shadowbench.device.point_visibility import PointVisibility
from shadowbench.light_space import light_frames
from shadowbench.light_space_kernel import LightSpaceKernel, footprint_points
from shadowbench.receivers import Receivers
from shadowbench.reference import Reference
from shadowbench.scene import DirectionalLight, Light, PointLight, SpotLight
from shadowbench.world import World

POINT_COUNT = 64
"""Points of a footprint unless said otherwise."""

POINTS_AT_ONCE = 1 << 22
"""Points asked at a time: half a gigabyte, and long enough for the casters' share of the work to be small."""

_BEYOND = 1.1
"""Points go this much farther than the farthest caster can be."""

_SLACK = 1.01
"""A widened cone is this much wider than its footprints: a stored point is a rounded one."""

_WIDEST_ANGLE = 170.0
"""Of a spot light [degrees]."""


@dataclass(frozen=True, eq=False)
class FilteredReference:
    """Filtered ground truth of a picture, a light and a kernel.

    Attributes:
        visibility: Mean over the footprint, 0 where turned away or out of the light's field, float32, shape [n], or
            [n, 3] where casters are translucent.
        half_difference: Half the difference between the means over the two halves of the points, of the same shape: an
            estimate of the mean's own error.
    """

    visibility: NDArray[np.float32]
    half_difference: NDArray[np.float32]

    def error(self, scored: NDArray[np.bool_]) -> float | None:
        """Return the estimated root mean square error over the receivers in ``scored``, ``None`` if there are none."""
        chosen = self.half_difference[scored].astype(np.float64)
        return float(np.sqrt(np.mean(chosen * chosen))) if chosen.size else None


def filtered_reference(
    world: World,
    receivers: Receivers,
    light: Light,
    hard: Reference,
    kernel: LightSpaceKernel,
    context: Context,
    *,
    point_count: int = POINT_COUNT,
    points_at_once: int = POINTS_AT_ONCE,
) -> FilteredReference:
    """Filter the ground truth; the same bits for every number of threads and of points asked at once.

    Args:
        world: The placed scene.
        receivers: Made of this world.
        light: One of the world's lights.
        hard: Says which receivers are turned away or out of the light's field.
        kernel: The filter.
        context: Where to run.
        point_count: Points of each footprint, a power of two.
        points_at_once: Bounds memory, at some 120 bytes a point.

    Raises:
        SceneError: The light has an area.
        ValueError: ``point_count`` is not a power of two.
    """
    asked_as, rays = _rays(world, light, kernel, context)
    offsets = as_warp(footprint_points(kernel, point_count), wp.vec2d, context.device)
    asked = np.flatnonzero(hard.in_field & ~hard.turned_away).astype(np.int32)
    channels = 1 if world.casters.is_opaque else 3
    outputs = [wp.zeros((receivers.count, channels), dtype=wp.float32, device=context.device) for _ in range(2)]
    engine = PointVisibility(world.casters, asked_as, context)
    on_device = receivers.on(context.device)
    block = max(1, points_at_once // point_count)
    for begin in range(0, len(asked), block):
        chosen = as_warp(asked[begin : begin + block], wp.int32, context.device)
        count = chosen.shape[0]
        point = wp.empty((count, point_count), dtype=wp.vec3, device=context.device)
        inputs = [rays, offsets, chosen, on_device.position, on_device.normal]
        launch(spread_points, count, inputs=inputs, outputs=[point], context=context)
        shape = (count * point_count,) if channels == 1 else (count * point_count, channels)
        visibility = wp.empty(shape, dtype=wp.float32, device=context.device)
        engine.ask(point.flatten(), visibility)
        by_footprint = visibility.reshape((count, point_count, channels))
        launch(average_halves, count, inputs=[by_footprint, chosen], outputs=outputs, context=context)
    synchronize(context)
    shape = (receivers.count,) if channels == 1 else (receivers.count, channels)
    return FilteredReference(*(array.numpy().reshape(shape) for array in outputs))


def _rays(world: World, light: Light, kernel: LightSpaceKernel, context: Context) -> tuple[Light, Any]:
    """Return the light as points are asked about it, and its :class:`LightRays` through the window's texels.

    Raises:
        SceneError: The light has an area.
    """
    frames = light_frames(light, world)
    rays: Any = LightRays()  # its members are Warp's types to a checker, Python's numbers to us
    rays.axes = wp.array(np.stack([frame.axes for frame in frames]), dtype=wp.mat33d, device=context.device)
    rays.texel = wp.vec2d(*(side / kernel.resolution for side in frames[0].extent))
    rays.widest = math.inf
    if isinstance(light, DirectionalLight):
        rays.farthest = _BEYOND * world.diagonal()
        return light, rays
    assert isinstance(light, SpotLight | PointLight)
    low, high = (bound.astype(np.float64) for bound in world.bounds())
    position = np.asarray(light.position)
    reach = np.maximum(np.abs(low - position), np.abs(high - position))
    rays.is_positional, rays.position = 1, wp.vec3d(*light.position)
    rays.farthest = _BEYOND * math.sqrt(float(reach[0] ** 2 + reach[1] ** 2 + reach[2] ** 2))
    if isinstance(light, SpotLight):
        corner = 1.0 + math.sqrt(2.0) * kernel.width / kernel.resolution  # from the cone, half a width along u and v
        tangent = math.tan(math.radians(light.angle) / 2.0) * corner * _SLACK**2
        light = replace(light, angle=min(math.degrees(2.0 * math.atan(tangent)), _WIDEST_ANGLE))
        rays.widest = math.tan(math.radians(light.angle) / 2.0) / _SLACK
    return light, rays
