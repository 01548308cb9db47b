"""Accounts of exact shadow tests: the triangles that cover a receiver in the light's window, and the test of each.

What rays and the rasterisers at the receivers' own places tell alike, since they decide by the same predicate. Every
triangle of the casters is asked, with no tree: slow, and independent of what found them in a frame.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from shadowbench.account import Account, Quantity, Step, Table, number, plain
from shadowbench.device.account_kernels import tell_crossings, tell_surface_ray
from shadowbench.device.arrays import as_warp
from shadowbench.device.launch import Context, launch, synchronize
from shadowbench.device.visibility import light_point, plane_tolerance
from shadowbench.light_space import is_in_field_of_view
from shadowbench.receivers import Receivers
from shadowbench.scene import Light
from shadowbench.world import Casters

MOST_LISTED = 24
"""Triangles that an account lists, nearest first."""

_AT_LIGHT = "it lies in the light's very place: lit"


@dataclass(frozen=True)
class Covering:
    """A triangle that covers the receiver.

    Attributes:
        instance: Among the casters.
        triangle: Number within its mesh.
        crossed: Parameter along the ray where it counts as crossed; -1 if it does not.
        height: Of its plane over the ray's origin, signed [scene units].
    """

    instance: int
    triangle: int
    crossed: float
    height: float


def exact_account(casters: Casters, light: Light, receivers: Receivers, index: int, context: Context) -> Account:
    """Return the account of the ground truth's rule: the ray starts on the surface, and planes through it are left out.

    Args:
        casters: What casts.
        light: Directional, spot or point.
        receivers: The visible samples.
        index: Which one.
        context: Where to run.
    """
    receiver, dark = receivers.only(index), 0.0 if casters.is_opaque else (0.0, 0.0, 0.0)
    if not is_in_field_of_view(light, receiver.position)[0]:
        return Account((Step("known without a ray", formula=("outside the light's cone: shadowed",)),), dark)
    towards, reach, is_away = _surface_ray(casters, light, receiver, context)
    if is_away:
        why = "its own plane parts the eye from the light: turned away, shadowed"
        return Account((Step("known without a ray", formula=(why,)),), dark)
    if not towards.any():
        lit = 1.0 if casters.is_opaque else (1.0, 1.0, 1.0)
        return Account((Step("known without a ray", formula=(_AT_LIGHT,)),), lit)
    origin = receiver.position[0].astype(np.float64)
    tolerance = plane_tolerance(casters.scale)
    ray = ray_step(origin, towards, reach, tolerance)
    found = list(_covering(casters, origin, towards, reach, tolerance, context))
    if casters.is_opaque:
        blocked = any(covering.crossed > 0.0 for covering in found)
        result: float | tuple[float, ...] = 0.0 if blocked else 1.0
    else:
        result = _light_through(casters, found)
    return Account((ray, covering_step(casters, found, towards, tolerance, result)), result)


def offset_account(
    casters: Casters, origin: NDArray[np.float32], towards: NDArray[np.float32], reach: float, context: Context
) -> Account:
    """Return the account of a ray in float32 from a point off its surface: everything that it crosses counts."""
    from_point, along = origin.astype(np.float64), towards.astype(np.float64)
    found = list(_covering(casters, from_point, along, reach, 0.0, context))
    result = 0.0 if any(covering.crossed > 0.0 for covering in found) else 1.0
    ray = ray_step(from_point, along, reach, 0.0)
    return Account((ray, covering_step(casters, found, along, 0.0, result)), result)


def ray_step(origin: NDArray[np.float64], towards: NDArray[np.float64], reach: float, tolerance: float) -> Step:
    """Return the step that says which ray is asked about."""
    return Step(
        "shadow ray",
        (
            Quantity("origin", plain(origin), "scene units"),
            Quantity("towards the light", plain(towards)),
            Quantity("reach along it", reach),
            Quantity("planes nearer than this are its own", tolerance, "scene units"),
        ),
    )


def covering_step(
    casters: Casters,
    found: list[Covering],
    towards: NDArray[np.float64],
    tolerance: float,
    result: float | tuple[float, ...],
) -> Step:
    """Return the step that lists the triangles in the ray's way, or on the other side of its origin."""
    length = float(np.sqrt((towards * towards).sum()))
    ordered = sorted(found, key=lambda c: (c.crossed <= 0.0, c.crossed if c.crossed > 0.0 else abs(c.height)))
    rows = []
    for covering in ordered[:MOST_LISTED]:
        name = casters.meshes[casters.instances[covering.instance].mesh].name
        is_own = abs(covering.height) <= tolerance
        why = "crossed" if covering.crossed > 0.0 else ("own plane" if is_own else "behind, or beyond the light")
        distance = covering.crossed * length if covering.crossed > 0.0 else float("nan")
        rows.append((name, covering.instance, covering.triangle, covering.height, distance, why))
    crossed = sum(covering.crossed > 0.0 for covering in found)
    columns = ("mesh", "caster", "triangle", "plane's height", "distance", "test")
    shown = f"{len(found)} triangles cover the receiver in the light's window, {crossed} are crossed"
    channels = result if isinstance(result, tuple) else (result,)
    if len(channels) > 1:
        formula = f"visibility = product of transmittances of what is crossed = {', '.join(map(number, channels))}"
    else:
        formula = f"visibility = {number(channels[0])}: " + ("nothing is crossed" if channels[0] else "it is blocked")
    if len(found) > MOST_LISTED:
        shown += f"; the first {MOST_LISTED} are listed"
    return Step("triangles that cover the receiver", (), (shown, formula), Table("triangles", columns, tuple(rows)))


def _surface_ray(
    casters: Casters, light: Light, receiver: Receivers, context: Context
) -> tuple[NDArray[np.float64], float, bool]:
    """Return the ray's direction and reach, and whether the receiver's own triangle hides it."""
    device, world = context.device, casters.world
    own = world.corners_of(receiver.triangle)[0]
    towards = wp.zeros(1, dtype=wp.vec3d, device=device)
    reach = wp.zeros(1, dtype=wp.float64, device=device)
    turned_away = wp.zeros(1, dtype=wp.int32, device=device)
    inputs = [light_point(light), wp.vec3d(*receiver.eye), as_warp(own, wp.vec3, device), receiver.on(device).position]
    launch(tell_surface_ray, 1, inputs=inputs, outputs=[towards, reach, turned_away], context=context)
    synchronize(context)
    return towards.numpy()[0], float(reach.numpy()[0]), bool(turned_away.numpy()[0])


def _covering(
    casters: Casters,
    origin: NDArray[np.float64],
    towards: NDArray[np.float64],
    reach: float,
    tolerance: float,
    context: Context,
) -> Iterator[Covering]:
    """Yield the casters' triangles that cover the origin in the light's window, in file order."""
    device = context.device
    for block in casters.blocks():
        count = len(block.corners)
        crossed, once, height = (wp.empty(count, dtype=wp.float64, device=device) for _ in range(3))
        covers = wp.empty(count, dtype=wp.int32, device=device)
        corner: wp.array[Any] = as_warp(block.corners.reshape(-1, 3), wp.vec3, device)
        inputs = [corner, wp.vec3d(*origin), wp.vec3d(*towards), reach, tolerance]
        outputs = [crossed, once, covers, height]
        launch(tell_crossings, count, inputs=inputs, outputs=outputs, context=context)
        synchronize(context)
        is_opaque = max(casters.instances[block.instance].transmittance) == 0.0
        counted = (crossed if is_opaque else once).numpy()
        for k in np.flatnonzero((covers.numpy() != 0) | (counted > 0.0)).tolist():
            yield Covering(block.instance, block.first_triangle + k, float(counted[k]), float(height.numpy()[k]))


def _light_through(casters: Casters, found: list[Covering]) -> tuple[float, ...]:
    """Return the product of the transmittances of what is crossed, by channel, in file order and in float32."""
    through = np.ones(3, np.float32)
    for covering in found:
        if covering.crossed > 0.0:
            through = through * np.array(casters.instances[covering.instance].transmittance, np.float32)
    return tuple(float(channel) for channel in through)
