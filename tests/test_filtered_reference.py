"""The filtered ground truth against closed forms, against rays through its own points, and in its degenerate cases."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from builders import box_over_ground, square
from footprints import half_plane_share
from irregular import WORLDS
from surfaces import grid, receivers_at, scattered_receivers, soup, world_of

from shadowbench.device.launch import Context
from shadowbench.errors import SceneError
from shadowbench.filtered_reference import filtered_reference
from shadowbench.light_space import cube_face_of, light_frames
from shadowbench.light_space_kernel import LightSpaceKernel, footprint_points
from shadowbench.receivers import Receivers
from shadowbench.reference import hard_reference
from shadowbench.scene import DirectionalLight, PointLight, RectangularLight, SpotLight
from shadowbench.world import World

CONTEXT = Context(threads=2)

LIGHTS = {
    "overhead": DirectionalLight((0.0, 1.0, 0.0)),
    "slanted": DirectionalLight((0.3, 1.0, -0.2)),
    "spot": SpotLight((0.2, 3.0, 0.1), (0.0, -1.0, 0.0), 70.0),
    "point": PointLight((0.2, 3.0, 0.1)),
}

KERNELS = {
    "box": LightSpaceKernel("box", 5.0, 24),
    "gauss": LightSpaceKernel("gauss", 5.0, 24, 1.1),
    "bilinear": LightSpaceKernel("bilinear", 2.0, 12),
}


def filtered(world: World, receivers: Receivers, light: str, kernel: LightSpaceKernel, **changes: Any) -> Any:
    placed = world.lights[light]
    hard = hard_reference(world, receivers, placed, CONTEXT)
    return filtered_reference(world, receivers, placed, hard, kernel, changes.pop("context", CONTEXT), **changes)


def half_plane(angle: float, transmittance: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> tuple[World, Any]:
    """A ground of two triangles under a sheet that ends at a straight edge; also two points of the edge.

    Args:
        angle: Of the edge to the x axis [degrees].
        transmittance: Of the sheet and the ground.
    """
    cosine, sine = np.cos(np.radians(angle)), np.sin(np.radians(angle))
    flat = np.array([(-3.0, 0.1), (3.0, 0.1), (3.0, 3.0), (-3.0, 3.0)])
    turned = np.stack([flat[:, 0] * cosine - flat[:, 1] * sine, flat[:, 0] * sine + flat[:, 1] * cosine], axis=1)
    sheet = np.insert(turned, 1, 0.5, axis=1).astype(np.float32)
    triangles = np.array([(0, 1, 2), (0, 2, 3)])
    world = world_of(square(2.0), (sheet, triangles), lights=LIGHTS, transmittance=transmittance)
    return world, sheet[:2]


def near_edge(world: World, count: int, seed: int) -> Receivers:
    """Receivers on the middle of the ground, well inside the sheet's span."""
    rng = np.random.default_rng(seed)
    anywhere = receivers_at(world, np.zeros(count, int), rng.dirichlet((1.0, 1.0, 1.0), count))
    position = rng.uniform((-0.6, 0.0, -0.6), (0.6, 0.0, 0.6), (count, 3)).astype(np.float32)
    return replace(anywhere, position=position)


def lit_share(world: World, receivers: Receivers, light: str, kernel: LightSpaceKernel, edge: Any) -> Any:
    """The share of each footprint on the lit side of the edge, in texels of the window: a straight line there too."""
    placed = world.lights[light]
    frames = light_frames(placed, world)
    face = 3 if light == "point" else 0  # straight below
    here, there = frames[face].project(edge)[:, :2] * kernel.resolution
    normal = np.array([there[1] - here[1], here[0] - there[0]])
    normal /= np.linalg.norm(normal)
    (within,) = frames[face].project(np.array([[0.0, 0.5, 1.5]]))[:, :2] * kernel.resolution
    if (within - here) @ normal < 0.0:
        normal = -normal
    offsets = (here - frames[face].project(receivers.position)[:, :2] * kernel.resolution) @ normal
    return np.array([half_plane_share(kernel, normal, offset) for offset in offsets])


def rms(values: Any) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


@pytest.mark.parametrize("angle", [0.0, 27.0])
@pytest.mark.parametrize("shape", KERNELS)
@pytest.mark.parametrize("light", LIGHTS)
def test_beside_a_straight_edge_it_is_the_share_of_the_kernel_on_the_lit_side(light, shape, angle):
    world, edge = half_plane(angle)
    receivers = near_edge(world, 600, 3)
    truth = lit_share(world, receivers, light, KERNELS[shape], edge)
    found = filtered(world, receivers, light, KERNELS[shape])
    between = (truth > 0.0) & (truth < 1.0)
    assert between.sum() > 100
    assert rms((found.visibility - truth)[between]) < 0.02
    # on either side, away from the edge, there is nothing to be wrong about
    assert (found.visibility[truth == 0.0] == 0.0).all()
    assert (found.visibility[truth == 1.0] == 1.0).all()
    assert (found.half_difference[~between] == 0.0).all()


@pytest.mark.parametrize("shape", KERNELS)
def test_its_error_falls_with_more_points_and_its_estimate_tracks_it(shape):
    kernel = KERNELS[shape]
    errors, ratios = [], []
    for count in (16, 64, 256, 1024):
        differences, estimates = [], []
        for angle in (0.0, 13.0, 27.0, 45.0, 71.0):
            world, edge = half_plane(angle)
            receivers = near_edge(world, 400, 4)
            truth = lit_share(world, receivers, "slanted", kernel, edge)
            between = (truth > 0.0) & (truth < 1.0)
            found = filtered(world, receivers, "slanted", kernel, point_count=count)
            differences.append((found.visibility - truth)[between])
            estimates.append(found.half_difference[between])
            assert found.error(between) == pytest.approx(rms(found.half_difference[between]))
        errors.append(rms(np.concatenate(differences)))
        ratios.append(rms(np.concatenate(estimates)) / errors[-1])
    falls = -np.diff(np.log(errors)) / np.log(4.0)
    assert (falls > 0.6).all(), falls  # random points have 0.5
    assert all(1.0 < ratio < 1.7 for ratio in ratios[1:]), ratios  # on the safe side
    assert 1.0 < ratios[0] < 2.5


def test_through_a_translucent_sheet_channels_are_dimmed_by_the_share_behind_it():
    world, edge = half_plane(27.0, transmittance=(0.5, 0.25, 0.0))
    receivers = near_edge(world, 600, 5)
    behind = 1.0 - lit_share(world, receivers, "overhead", KERNELS["box"], edge)
    found = filtered(world, receivers, "overhead", KERNELS["box"])
    assert found.visibility.shape == found.half_difference.shape == (600, 3)
    expected = 1.0 - behind[:, None] * (1.0 - np.array([0.5, 0.25, 0.0]))
    assert rms(found.visibility - expected) < 0.012
    opaque = filtered(half_plane(27.0)[0], receivers, "overhead", KERNELS["box"])
    np.testing.assert_allclose(found.visibility[:, 2], opaque.visibility, atol=1e-7)


@pytest.mark.parametrize("light", ["directional", "spot", "point inside", "point with a near plane"])
def test_a_footprint_of_no_width_asks_about_the_receiver_itself(light):
    world, receivers = WORLDS["solids"]()
    hard = hard_reference(world, receivers, world.lights[light], CONTEXT)
    found = filtered(world, receivers, light, LightSpaceKernel("box", 1e-9, 64))
    sure = np.isin(found.visibility, (0.0, 1.0))
    assert sure.mean() > 0.99  # an edge may pass within a float32 rounding of the receiver
    np.testing.assert_array_equal(found.visibility[sure], hard.visibility[sure])


@pytest.mark.parametrize("degrees", [1.0, 30.0])
def test_a_tessellated_plane_does_not_shadow_itself_however_wide_the_kernel(degrees):
    rng = np.random.default_rng(6)
    flat, triangles = grid(16, 1.0)
    axes, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    up = axes @ (0.0, 1.0, 0.0)
    towards = axes @ (np.cos(np.radians(degrees)), np.sin(np.radians(degrees)), 0.0)
    world = world_of(((flat @ axes.T).astype(np.float32), triangles), lights={"low": DirectionalLight(tuple(towards))})
    eye = tuple(3.0 * up)
    receivers = receivers_at(world, rng.integers(0, 512, 2000), rng.dirichlet((1.0, 1.0, 1.0), 2000), eye=eye)
    for width in (1.0, 16.0, 64.0):
        found = filtered(world, receivers, "low", LightSpaceKernel("box", width, 64))
        assert (found.visibility == 1.0).all()


@pytest.mark.parametrize("light", ["directional", "spot", "spot with a near plane", "point inside"])
@pytest.mark.parametrize("name", ["solids", "soup"])
def test_it_is_the_mean_of_rays_from_points_found_by_solving_for_them(name, light):
    world, receivers = WORLDS[name]()
    receivers = _some(receivers, slice(0, None, 20))
    placed = world.lights[light]
    kernel = LightSpaceKernel("gauss", 7.0, 48, 1.4)
    offsets = footprint_points(kernel, 16) / kernel.resolution
    points, stays = _points_of_plane(world, placed, receivers, offsets)
    asked = replace(placed, angle=170.0) if isinstance(placed, SpotLight) else placed
    hard = hard_reference(world, receivers, placed, CONTEXT)
    compared = stays & hard.in_field & ~hard.turned_away
    assert compared.sum() > 80
    rays = np.stack([_rays(world, receivers, asked, points[:, k]) for k in range(16)], axis=1)
    found = filtered(world, receivers, light, kernel, point_count=16)
    difference = np.abs(found.visibility - rays.mean(axis=1))[compared]
    # the same real point rounds to another float32 now and then, and a ray that close to an edge may change sides
    assert (difference < 1e-6).mean() > 0.97
    assert difference.max() <= 1.0 / 16.0 + 1e-6
    assert 0.05 < found.visibility[compared].mean() < 0.95


def _some(receivers: Receivers, chosen: slice) -> Receivers:
    count = len(range(*chosen.indices(receivers.count)))
    of_receiver = ("layer", "weight", "alpha", "position", "normal", "instance", "triangle", "valid")
    arrays = {name: np.ascontiguousarray(getattr(receivers, name)[chosen]) for name in of_receiver}
    pixels = {"pixel": np.arange(count, dtype=np.int32), "first_of_pixel": np.arange(count + 1, dtype=np.int32)}
    return replace(receivers, width=count, **arrays, **pixels)


def _points_of_plane(world: World, light: Any, receivers: Receivers, offsets: Any) -> tuple[Any, Any]:
    """Points with given window coordinates on each receiver's plane: three linear equations each.

    Also which receivers have all of them in front of the light and within the world.
    """
    frames = light_frames(light, world)
    p, n = receivers.position.astype(np.float64), receivers.normal.astype(np.float64)
    face = np.zeros(receivers.count, int) if len(frames) == 1 else cube_face_of(p - np.array(light.position))
    points = np.empty((receivers.count, len(offsets), 3))
    stays = np.ones(receivers.count, bool)
    for i in range(receivers.count):
        frame = frames[face[i]]
        u, v = frame.project(p[i : i + 1])[0, :2]
        for k, (du, dv) in enumerate(offsets):
            rows = frame.projection[[0, 1]] - np.outer((u + du, v + dv), frame.projection[3])
            a, b = np.vstack([rows[:, :3], n[i]]), np.append(-rows[:, 3], n[i] @ p[i])
            points[i, k] = np.linalg.solve(a, b)
            w = frame.projection[3] @ np.append(points[i, k], 1.0)
            stays[i] &= w > 0.0 and np.abs(points[i, k] - p[i]).max() < world.diagonal()
    return points.astype(np.float32), stays


def _rays(world: World, receivers: Receivers, light: Any, position: Any) -> Any:
    moved = replace(receivers, position=np.ascontiguousarray(position))
    return hard_reference(world, moved, light, CONTEXT).visibility


@pytest.mark.parametrize("light", ["directional", "spot", "point inside"])
@pytest.mark.parametrize("transmittance", [(0.0, 0.0, 0.0), (0.5, 0.75, 0.25)])
def test_threads_and_blocks_do_not_change_a_bit(light, transmittance):
    rng = np.random.default_rng(7)
    lights = {"directional": LIGHTS["slanted"], "spot": LIGHTS["spot"], "point inside": PointLight((0.2, 0.6, 0.1))}
    world = world_of(soup(150, rng), lights=lights, transmittance=transmittance)
    receivers = scattered_receivers(world, 400, rng, on_edges=0.3)
    kernel = LightSpaceKernel("gauss", 5.0, 64, 1.1)
    whole = filtered(world, receivers, light, kernel, context=Context())
    for context, points in ((Context(threads=2), 1 << 22), (Context(threads=2), 64 * 90), (Context(), 64 * 150)):
        other = filtered(world, receivers, light, kernel, context=context, points_at_once=points)
        np.testing.assert_array_equal(other.visibility, whole.visibility)
        np.testing.assert_array_equal(other.half_difference, whole.half_difference)
    assert (whole.half_difference > 0.0).any()


def test_receivers_turned_away_or_outside_the_cone_are_in_shadow():
    lights = {"spot": SpotLight((0.0, 2.0, 0.0), (0.0, -1.0, 0.0), 40.0)}
    world = world_of(square(3.0), lights=lights)
    above = receivers_at(world, np.array([0, 0]), np.array([[1.0, 0.0, 0.0], [0.5, 0.0, 0.5]]))
    below = receivers_at(world, np.array([0]), np.array([[0.5, 0.0, 0.5]]), eye=(0.0, -2.0, 0.0))
    assert filtered(world, above, "spot", KERNELS["box"]).visibility.tolist() == [0.0, 1.0]
    assert filtered(world, below, "spot", KERNELS["box"]).visibility.tolist() == [0.0]


@pytest.mark.parametrize("angle", [40.0, 169.5, 170.0])
def test_the_outline_of_a_spot_lights_cone_is_not_blurred(angle):
    lights = {"spot": SpotLight((0.0, 1.0, 0.0), (0.0, -1.0, 0.0), angle)}
    world = world_of(square(20.0), lights=lights)
    rng = np.random.default_rng(8)
    receivers = receivers_at(world, rng.integers(0, 2, 4000), rng.dirichlet((1.0, 1.0, 1.0), 4000))
    found = filtered(world, receivers, "spot", LightSpaceKernel("box", 9.0, 32))
    inside = np.hypot(*receivers.position[:, [0, 2]].T) < np.tan(np.radians(angle / 2.0))
    assert inside.sum() > 2
    assert (~inside).sum() > 100
    np.testing.assert_array_equal(found.visibility, inside)


def test_beyond_a_planes_horizon_points_lie_behind_everything():
    # the lamp sees the ground up to the horizon, which is the window's middle line; behind stands a wall on the ground
    wall = np.array([(3.0, 0.0, -20.0), (3.0, 0.0, 20.0), (3.0, 8.0, 20.0), (3.0, 8.0, -20.0)], np.float32)
    lights = {"lamp": PointLight((0.0, 0.5, 0.0))}
    world = world_of(square(1.0), (wall, np.array([(0, 1, 2), (0, 2, 3)])), lights=lights)
    receivers = receivers_at(world, np.array([0]), np.array([[0.2, 0.0, 0.8]]))
    assert receivers.position.tolist() == [pytest.approx((0.6, 0.0, 0.6))]
    receivers = replace(receivers, position=np.array([(0.6, 0.0, 0.1)], np.float32))
    half = 0.9  # of the footprint, as a tangent; the window of a cube's face reaches from -1 to 1
    found = filtered(world, receivers, "lamp", LightSpaceKernel("box", half * 64, 64), point_count=1024)
    # rays that meet the ground before the wall are lit; those that meet it behind, or never, pass the wall
    lit = (0.5 / 0.6 + half - 0.5 / 3.0) / (2.0 * half)
    assert found.visibility[0] == pytest.approx(lit, abs=0.002)


@pytest.mark.parametrize("slope", [0.0, 1e-12, 1e-6, 1e-3])
def test_a_plane_seen_edge_on_is_as_long_as_the_world(slope):
    # light along the ground, from +x; a wall far behind the receiver is in the way of what lies behind the wall
    wall = np.array([(-1.0, 0.0, -4.0), (-1.0, 0.0, 4.0), (-1.0, 2.0, 4.0), (-1.0, 2.0, -4.0)], np.float32)
    world = world_of(
        square(2.0), (wall, np.array([(0, 1, 2), (0, 2, 3)])), lights={"low": DirectionalLight((1.0, slope, 0.0))}
    )
    receivers = receivers_at(world, np.array([0]), np.array([[0.5, 0.0, 0.5]]))
    found = filtered(world, receivers, "low", LightSpaceKernel("box", 16.0, 32), point_count=1024)
    assert np.isfinite(found.visibility).all()
    if slope > 0.0:
        # rays above the receiver meet its plane behind the wall, those below between it and the light
        assert found.visibility[0] == pytest.approx(0.5, abs=0.01)


def test_a_lamp_in_the_receivers_own_plane_gives_finite_answers():
    world = world_of(square(2.0), square(0.2, 0.5), lights={"lamp": PointLight((1.0, 0.0, 0.25))})
    receivers = receivers_at(world, np.array([0, 1]), np.array([[0.5, 0.0, 0.5], [0.2, 0.2, 0.6]]))
    found = filtered(world, receivers, "lamp", KERNELS["box"])
    assert ((found.visibility >= 0.0) & (found.visibility <= 1.0)).all()


def test_area_lights_are_refused_in_one_line():
    world = box_over_ground()
    receivers = receivers_at(world, np.array([0]), np.array([[0.4, 0.3, 0.3]]))
    hard = hard_reference(world, receivers, world.lights["sun"], CONTEXT)
    panel = RectangularLight((0.0, 2.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0))
    with pytest.raises(SceneError, match="area"):
        filtered_reference(world, receivers, panel, hard, KERNELS["box"], CONTEXT)
