"""What the tests of the exact rasterising methods share: worlds that try them, and the comparison with the truth."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import warp as wp
from builders import box, square
from numpy.typing import NDArray
from surfaces import corners_of, grid, homogeneous, scattered_receivers, soup, sphere, world_of
from tracing import shaded

from shadowbench.device.launch import Context
from shadowbench.light_space import CUBE_AXES, camera_frame, is_in_field_of_view
from shadowbench.method import Changes, Method, Trace, View
from shadowbench.receivers import Receivers
from shadowbench.reference import hard_reference
from shadowbench.scene import DirectionalLight, Light, PointLight, SpotLight
from shadowbench.world import FlatTriangles, World

LIGHTS: dict[str, Light] = {
    "directional": DirectionalLight((0.4, 1.0, 0.3)),
    "overhead": DirectionalLight((0.0, 1.0, 0.0)),
    "grazing": DirectionalLight((1.0, 0.002, 0.1)),
    "spot": SpotLight((1.5, 4.0, 1.0), (-1.5, -4.0, -1.0), 50.0),
    "spot with a near plane": SpotLight((0.3, 1.5, 0.2), (0.0, -1.0, 0.0), 120.0, near=0.8),
    "point inside": PointLight((0.2, 0.6, 0.1)),
    "point with a near plane": PointLight((0.2, 0.6, 0.1), near=0.3),
    "point far away": PointLight((30.0, 80.0, 20.0)),
}


def soup_of(count: int) -> tuple[World, Receivers]:
    """Random triangles; half of the receivers on edges and vertices, where only the exact predicate can tell."""
    rng = np.random.default_rng(count)
    world = world_of(soup(count, rng), lights=LIGHTS)
    return world, scattered_receivers(world, 6000, rng, on_edges=0.5)


def solids() -> tuple[World, Receivers]:
    """A box and a sphere on a tessellated plane, one box face doubled: shared edges, contact, coplanar neighbours."""
    vertices, triangles = box((-0.5, 0.0, -0.5), (0.5, 1.0, 0.5))
    doubled = np.concatenate([triangles, triangles[:2]])
    world = world_of(
        grid(12, 2.0), (vertices, doubled), sphere(2, np.array([1.1, 0.4, 0.3]), 0.4), square(0.3, 1.0), lights=LIGHTS
    )
    return world, scattered_receivers(world, 6000, np.random.default_rng(5), on_edges=0.5)


def needles() -> tuple[World, Receivers]:
    """Triangles a few ulps thin, some seen edge-on, and specks smaller than the float32 filter resolves."""
    rng = np.random.default_rng(9)
    a = rng.uniform((-1.0, 0.2, -1.0), (1.0, 2.2, 1.0), (300, 3))
    length = rng.choice((1e-6, 1e-3, 1.0), (300, 1))
    b = a + length * rng.normal(size=(300, 3))
    height = rng.choice((0.0, 1e-7, 1e-5), (300, 1))
    c = a + rng.uniform(0.0, 1.0, (300, 1)) * (b - a) + height * rng.normal(size=(300, 3))
    corners = np.stack([a, b, c], axis=1).reshape(-1, 3).astype(np.float32)
    world = world_of(square(2.0), (corners, np.arange(900).reshape(-1, 3)), lights=LIGHTS)
    return world, scattered_receivers(world, 6000, np.random.default_rng(10), on_edges=0.3)


WORLDS = {"small soup": lambda: soup_of(60), "soup": lambda: soup_of(5000), "solids": solids, "needles": needles}


def scaled(world: World, receivers: Receivers, factor: float) -> tuple[World, Receivers]:
    """The same in another unit of length. A power of two changes exponents only, so no shadow may change."""

    def light_scaled(light: Any) -> Any:
        if isinstance(light, DirectionalLight):
            return light
        near = None if light.near is None else light.near * factor
        return replace(light, position=tuple(c * factor for c in light.position), near=near)

    lights = {name: light_scaled(light) for name, light in world.lights.items()}
    flat = FlatTriangles(world.vertices * np.float32(factor), world.triangles)
    eye = tuple(c * factor for c in receivers.eye)
    return (
        replace(
            world,
            kept_flat=flat,
            instance_bounds=world.instance_bounds * np.float32(factor),
            scale=world.scale * factor,
            lights=lights,
        ),
        replace(receivers, position=receivers.position * np.float32(factor), eye=eye),
    )


def differing(method: Method, world: World, receivers: Receivers, light: str) -> tuple[int, Trace]:
    """How many receivers differ from the ground truth, and what the method reported."""
    placed = world.lights[light]
    visibility, trace = shaded(method, world, placed, receivers)
    truth = hard_reference(world, receivers, placed, Context()).visibility
    return int(np.count_nonzero(visibility != truth)), trace


def shaded_in_colour(
    method: Method, world: World, light: Light, receivers: Receivers
) -> tuple[NDArray[np.float32], Trace]:
    """Build and shade once, by channel; return the visibility, shape [n, 3], and what was reported."""
    camera = next(iter(world.cameras.values()))
    view = View(camera, 8, 8, camera_frame(camera, 8, 8, world))
    everything = frozenset(range(len(world.casters.instances)))
    trace = Trace(method.context)
    visibility: Any = wp.full((receivers.count, 3), value=np.nan, dtype=wp.float32, device="cpu")
    method.build(world.casters, light, view, Changes(light=True, instances=everything, view=True), trace)
    method.shade(receivers, visibility, trace)
    return visibility.numpy(), trace


def light_through(world: World, receivers: Receivers, light: Light) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Every receiver against every caster triangle in float64, by NumPy: the product of what the crossed ones let
    through, shape [n, 3]; and which receivers' rays meet an edge, where the count is a matter of definition."""
    casters = world.casters
    corners = casters.vertices[casters.triangles].astype(np.float64)
    instance = np.repeat(np.arange(len(casters.instances)), np.diff(casters.first_triangle))
    transmittance = np.array([i.transmittance for i in casters.instances])[instance]
    a, b, c = corners.transpose(1, 0, 2)
    normal = np.cross(b - a, c - a)
    delta = 16 * 2.0**-23 * casters.scale
    point = np.array(homogeneous(light))
    own = corners_of(world)[receivers.triangle].astype(np.float64)
    own_normal = np.cross(own[:, 1] - own[:, 0], own[:, 2] - own[:, 0])

    through = np.ones((receivers.count, 3))
    touches_edge = np.zeros(receivers.count, bool)
    for i, p in enumerate(receivers.position.astype(np.float64)):
        towards = point[:3] - point[3] * p
        volumes = np.stack([np.cross(s - p, e - p) @ towards for s, e in ((b, c), (c, a), (a, b))])
        height, slope = ((a - p) * normal).sum(axis=1), normal @ towards
        reach = np.inf
        if not isinstance(light, DirectionalLight):
            forward = [light.direction] if isinstance(light, SpotLight) else [axes[0] for axes in CUBE_AXES]
            planar = max(-(np.array(f) @ towards) / np.linalg.norm(f) for f in forward)
            reach = 1.0 - (light.near or 0.0) / planar
        ahead = (height * slope > 0.0) & (np.abs(height) < reach * np.abs(slope))
        ahead &= np.abs(height) > delta * np.linalg.norm(normal, axis=1)
        size = np.abs(towards).sum() * np.abs(corners - p).max(axis=(1, 2)) ** 2
        near_edge = np.abs(volumes).min(axis=0) < 1e-13 * size
        crossed = ahead & ((volumes > 0.0).all(axis=0) | (volumes < 0.0).all(axis=0))
        touches_edge[i] = (near_edge & ahead & (np.abs(volumes.sum(axis=0)) > 0.0)).any()
        through[i] = transmittance[crossed].prod(axis=0)
        eye_side = own_normal[i] @ (np.array(receivers.eye) - own[i, 0])
        light_side = own_normal[i] @ (point[:3] - point[3] * own[i, 0])
        if eye_side * light_side < 0.0:
            through[i] = 0.0
    through[~is_in_field_of_view(light, receivers.position)] = 0.0
    return through, touches_edge
