"""Rays through the tree: filters against NumPy, the walk against trying every triangle."""

import numpy as np
import pytest
import warp as wp
from surfaces import corners_of, homogeneous, receivers_at, scattered_receivers, soup, world_of

from shadowbench.device.launch import Context, kernel_options, launch
from shadowbench.device.rays import (
    OffsetRays,
    boxes_crossed,
    is_blocked,
    lowest_lane,
    make_ray,
    nearest_blocker,
    triangles_not_missed,
)
from shadowbench.device.triangle_tree import TriangleTree
from shadowbench.device.triangle_tree_kernels import Tree, hilbert_index
from shadowbench.device.visibility import crossing, plane_tolerance
from shadowbench.scene import DirectionalLight, PointLight, SpotLight

wp.set_module_options(kernel_options(native=True))

CONTEXT = Context()


@wp.kernel
def trace(
    first: wp.int32,
    tree: Tree,
    tolerance: wp.float64,
    origin: wp.array[wp.vec3],
    towards: wp.array[wp.vec3d],
    reach: wp.array[wp.float64],
    blocked: wp.array[wp.int32],
    blocker: wp.array[wp.int32],
    parameter: wp.array[wp.float64],
):
    i = wp.tid() + first
    ray = make_ray(origin[i], towards[i], reach[i], tolerance)
    blocked[i] = wp.int32(is_blocked(tree, ray))
    found, t = nearest_blocker(tree, ray)
    blocker[i] = found
    parameter[i] = t


@wp.kernel
def try_every_triangle(
    first: wp.int32,
    vertices: wp.array[wp.vec3],
    indices: wp.array[wp.int32],
    tolerance: wp.float64,
    origin: wp.array[wp.vec3],
    towards: wp.array[wp.vec3d],
    reach: wp.array[wp.float64],
    blocker: wp.array[wp.int32],
    parameter: wp.array[wp.float64],
):
    i = wp.tid() + first
    nearest = wp.float64(wp.inf)
    found = wp.int32(-1)
    for k in range(indices.shape[0] // 3):
        a = vertices[indices[3 * k]]
        b = vertices[indices[3 * k + 1]]
        c = vertices[indices[3 * k + 2]]
        t = crossing(wp.vec3d(origin[i]), towards[i], reach[i], tolerance, a, b, c)
        if t > wp.float64(0.0) and t < nearest:
            nearest = t
            found = k
    blocker[i] = found
    parameter[i] = nearest


def assert_the_walk_misses_nothing(world, origins, towards, reach, tolerance=None, context=CONTEXT):
    """Compare the tree's answers with those of trying every triangle; return how many rays are blocked."""
    tolerance = plane_tolerance(world.scale) if tolerance is None else tolerance
    tree = TriangleTree(world.casters.triangle_count, context)
    tree.build(world.casters)
    triangles = world.casters.on("cpu")
    rays = [
        tolerance,
        wp.array(origins.astype(np.float32), dtype=wp.vec3, device="cpu"),
        wp.array(np.broadcast_to(towards, origins.shape).astype(np.float64), dtype=wp.vec3d, device="cpu"),
        wp.array(np.broadcast_to(reach, len(origins)).astype(np.float64), dtype=wp.float64, device="cpu"),
    ]
    blocked, blocker, expected = (wp.empty(len(origins), dtype=wp.int32, device="cpu") for _ in range(3))
    parameter, least = (wp.empty(len(origins), dtype=wp.float64, device="cpu") for _ in range(2))
    launch(trace, len(origins), [tree.packed(), *rays], [blocked, blocker, parameter], context=context)
    launch(
        try_every_triangle,
        len(origins),
        [triangles.vertices, triangles.triangles, *rays],
        [expected, least],
        context=context,
    )
    np.testing.assert_array_equal(blocker.numpy(), expected.numpy())
    np.testing.assert_array_equal(parameter.numpy(), least.numpy())
    np.testing.assert_array_equal(blocked.numpy(), expected.numpy() >= 0)
    return int(blocked.numpy().sum())


SUN = {"sun": DirectionalLight((0.35, 0.9, 0.25))}


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize(
    "towards",
    [
        (0.35, 0.9, 0.25),
        (-0.9, 0.35, 0.1),
        (0.0, 1.0, 0.0),
        (0.0, 0.0, -1.0),
        (1.0, 0.00174, 0.0),
        (1.0, 1e-8, -1e-20),
        (0.7, 0.7, 0.0),
        (1e-30, -1.0, 1e-30),
    ],
)
def test_parallel_rays_meet_what_trying_every_triangle_meets(towards, scale):
    rng = np.random.default_rng(1)
    vertices, triangles = soup(600, rng)
    world = world_of((vertices * np.float32(scale), triangles), lights=SUN)
    origins = scattered_receivers(world, 3000, rng, on_edges=0.5).position
    assert assert_the_walk_misses_nothing(world, origins, np.array(towards), np.inf) > 150


@pytest.mark.parametrize(
    "light",
    [(0.2, 0.6, 0.1), (1.5, 5.0, 1.0), (0.0, 1.0, 0.0), (3e6, 7e6, -2e6)],
    ids=["within", "near", "axis", "far"],
)
def test_rays_to_a_point_meet_what_trying_every_triangle_meets(light):
    rng = np.random.default_rng(2)
    world = world_of(soup(600, rng), lights=SUN)
    origins = scattered_receivers(world, 3000, rng, on_edges=0.5).position
    towards = np.array(light) - origins
    assert assert_the_walk_misses_nothing(world, origins, towards, 1.0) > 300


def test_flat_boxes_met_along_their_sides_are_not_missed():
    # axis-aligned plates, walls and rods of no extent along one axis or two; rays along the axes through their borders
    rng = np.random.default_rng(3)
    corners = rng.integers(-8, 9, (400, 3, 3)).astype(np.float32) / 8.0
    corners[np.arange(400), :, rng.integers(0, 3, 400)] = rng.integers(-8, 9, (400, 1)) / 8.0
    triangles = np.arange(1200).reshape(-1, 3)
    world = world_of((corners.reshape(-1, 3), triangles), lights=SUN)
    origins = rng.integers(-8, 9, (1500, 3)) / 8.0
    axes = np.concatenate([np.eye(3), -np.eye(3)])
    for axis in axes:
        assert assert_the_walk_misses_nothing(world, origins, axis, np.inf) > 500
    assert assert_the_walk_misses_nothing(world, origins, axes[rng.integers(0, 6, 1500)], np.inf) > 500


def test_slivers_and_specks_are_not_missed():
    rng = np.random.default_rng(4)
    start = rng.uniform(-1.0, 1.0, (500, 1, 3))
    along = rng.normal(size=(500, 1, 3))
    across = rng.normal(size=(500, 1, 3)) * 10.0 ** rng.uniform(-7.0, -3.0, (500, 1, 1))
    size = 10.0 ** rng.uniform(-4.0, 0.0, (500, 1, 1))
    corners = start + size * np.concatenate([0.0 * along, along, 0.5 * along + across], axis=1)
    world = world_of((corners.reshape(-1, 3).astype(np.float32), np.arange(1500).reshape(-1, 3)), lights=SUN)
    # aimed from a distance at points inside the slivers
    shares = rng.dirichlet((1.0, 1.0, 1.0), 4000)[:, :, None]
    targets = (shares * corners_of(world)[rng.integers(0, 500, 4000)]).sum(axis=1)
    towards = rng.normal(size=(4000, 3))
    origins = (targets - towards * rng.uniform(0.1, 0.5, (4000, 1))).astype(np.float32)
    origins = np.clip(origins, -world.scale, world.scale)
    aimed = targets - origins
    assert assert_the_walk_misses_nothing(world, origins, aimed, np.inf) > 500


def test_rays_that_start_off_the_scene_by_a_tenth_of_its_diagonal_are_covered():
    rng = np.random.default_rng(5)
    world = world_of(soup(400, rng), lights=SUN)
    outward = rng.normal(size=(2000, 3))
    origins = np.sign(outward) * world.scale + 0.1 * world.diagonal() * outward / np.abs(outward).max(axis=1)[:, None]
    inside = rng.uniform(-1.0, 1.0, (2000, 3)) * (1.0, 0.5, 1.0)
    assert assert_the_walk_misses_nothing(world, origins, inside - origins, np.inf, tolerance=0.0) > 500


@pytest.mark.parametrize("count", [1, 7, 8, 9, 64, 65, 513])
def test_trees_of_every_shape_hold_all_their_triangles(count):
    rng = np.random.default_rng(count)
    corners = rng.uniform(-1.0, 1.0, (count, 3, 3)).astype(np.float32)
    world = world_of((corners.reshape(-1, 3), np.arange(3 * count).reshape(-1, 3)), lights=SUN)
    centres = corners.mean(axis=1)
    towards = np.array([0.35, 0.9, 0.25])
    origins = (centres - 0.001 * towards).astype(np.float32)
    assert assert_the_walk_misses_nothing(world, origins, towards, np.inf) == count


def test_of_equally_near_triangles_the_lowest_number_is_the_blocker():
    roof = np.array([[-1, 1, -1], [1, 1, -1], [0, 1, 1], [5, 5, 5]], np.float32)
    world = world_of((roof, np.array([[0, 1, 3], [0, 1, 2], [0, 1, 2], [1, 2, 0]])), lights=SUN)
    tree = TriangleTree(4, CONTEXT)
    tree.build(world.casters)
    blocker = wp.empty(1, dtype=wp.int32, device="cpu")
    outputs = [wp.empty(1, dtype=wp.int32, device="cpu"), blocker, wp.empty(1, dtype=wp.float64, device="cpu")]
    rays = [
        wp.array([[0, 0, 0]], dtype=wp.vec3, device="cpu"),
        wp.array([[0, 1, 0]], dtype=wp.vec3d, device="cpu"),
        wp.array([np.inf], dtype=wp.float64, device="cpu"),
    ]
    launch(trace, 1, [tree.packed(), wp.float64(0.0), *rays], outputs, context=CONTEXT)
    assert blocker.numpy()[0] == 1


def test_a_tree_is_the_same_for_every_number_of_threads_and_when_built_again():
    rng = np.random.default_rng(6)
    world = world_of(soup(5000, rng), lights=SUN)
    other = world_of(soup(5000, rng), lights=SUN)
    one, two = TriangleTree(5002, Context(threads=1)), TriangleTree(5002, Context(threads=2))
    one.build(world.casters)
    two.build(other.casters)
    two.build(world.casters)
    for name in ("bounds", "corners", "triangle"):
        np.testing.assert_array_equal(getattr(one, name).numpy(), getattr(two, name).numpy())


def test_every_triangle_lies_in_the_inflated_boxes_above_it():
    rng = np.random.default_rng(7)
    world = world_of(soup(700, rng), lights=SUN)
    tree = TriangleTree(702, CONTEXT)
    tree.build(world.casters)
    corners = tree.corners.numpy().reshape(-1, 3, 3, 8)
    packs = len(corners)
    boxes = tree.bounds.numpy().reshape(-1, 2, 3, 8)
    parents = boxes[np.arange(packs) // 8, :, :, np.arange(packs) % 8]
    ulp = np.spacing(np.float32(world.scale))
    assert (parents[:, 0] <= np.nanmin(corners, axis=(1, 3)) - 7 * ulp).all()
    assert (parents[:, 1] >= np.nanmax(corners, axis=(1, 3)) + 7 * ulp).all()
    assert sorted(tree.triangle.numpy()) == [-1, -1, *range(702)]


@wp.kernel
def number_cells(first: wp.int32, bits: wp.int32, number: wp.array[wp.uint64]):
    i = wp.tid() + first
    last = (1 << bits) - 1
    x, y, z = wp.uint32(i & last), wp.uint32((i >> bits) & last), wp.uint32(i >> (2 * bits))
    number[i] = hilbert_index(x, y, z, wp.uint32(1 << (bits - 1)))


def test_the_curve_visits_every_cell_and_steps_to_a_neighbour_each_time():
    bits = 4
    number = wp.empty(1 << (3 * bits), dtype=wp.uint64, device="cpu")
    launch(number_cells, len(number), [bits], [number], context=CONTEXT)
    order = np.argsort(number.numpy())
    np.testing.assert_array_equal(np.sort(number.numpy()), np.arange(len(order)))
    cells = np.stack([order & 15, (order >> 4) & 15, order >> 8], axis=1)
    np.testing.assert_array_equal(np.abs(np.diff(cells, axis=0)).sum(axis=1), 1)


@wp.kernel
def filter_lanes(
    first: wp.int32,
    bounds: wp.array[wp.float32],
    corners: wp.array[wp.float32],
    origin: wp.array[wp.vec3],
    towards: wp.array[wp.vec3d],
    limit: wp.float32,
    margin: wp.float32,
    boxes: wp.array[wp.uint32],
    triangles: wp.array[wp.uint32],
    lowest: wp.array[wp.int32],
    inverse: wp.array[wp.vec3],
    shear: wp.array[wp.vec2],
    axis: wp.array[wp.int32],
):
    i = wp.tid() + first
    ray = make_ray(origin[i], towards[i], wp.float64(1.0), wp.float64(0.0))
    boxes[i] = boxes_crossed(bounds, i, ray.origin, ray.inverse, limit)
    forward = ray.inverse[ray.axis]
    triangles[i] = triangles_not_missed(corners, i, ray.origin, ray.axis, forward, ray.shear, margin)
    lowest[i] = lowest_lane(boxes[i] | wp.uint32(0x40000000))
    inverse[i] = ray.inverse
    shear[i] = ray.shear
    axis[i] = ray.axis


def test_the_native_filters_round_as_float32_numpy_does():
    rng = np.random.default_rng(8)
    count = 4000
    towards = rng.normal(size=(count, 3))
    towards[:500, 0] = 0.0
    towards[400:900, 2] = 0.0
    origin = rng.uniform(-1.0, 1.0, (count, 3)).astype(np.float32)
    low = rng.uniform(-1.0, 1.0, (count, 3, 8)).astype(np.float32)
    box = np.stack([low, low + rng.uniform(0.0, 1.0, low.shape).astype(np.float32)], axis=1)
    box[:, :, :, 7] = np.array([np.inf, -np.inf])[None, :, None]  # absent
    corners = rng.uniform(-1.0, 1.0, (count, 3, 3, 8)).astype(np.float32)
    corners[:, :, :, 6] = np.nan  # absent
    limit, margin = np.float32(0.7), np.float32(0.05)
    types = [wp.uint32, wp.uint32, wp.int32, wp.vec3, wp.vec2, wp.int32]
    outputs = [wp.empty(count, dtype=t, device="cpu") for t in types]
    inputs = [
        wp.array(box.ravel(), dtype=wp.float32, device="cpu"),
        wp.array(corners.ravel(), dtype=wp.float32, device="cpu"),
        wp.array(origin, dtype=wp.vec3, device="cpu"),
        wp.array(towards, dtype=wp.vec3d, device="cpu"),
        limit,
        margin,
    ]
    launch(filter_lanes, count, inputs, outputs, context=CONTEXT)
    boxes, triangles, lowest, inverse, shear, axis = (o.numpy() for o in outputs)

    np.testing.assert_array_equal(axis, np.abs(towards).argmax(axis=1))
    sides = (box - origin[:, None, :, None]) * inverse[:, None, :, None]
    backwards = (inverse < 0)[:, :, None]
    enter = np.where(backwards, sides[:, 1], sides[:, 0]).max(axis=1)
    leave = np.where(backwards, sides[:, 0], sides[:, 1]).min(axis=1)
    crossed = (enter <= leave) & (leave >= 0) & (enter <= limit)
    assert crossed[:, :7].any()
    assert not crossed[:, 7].any()
    bits = (1 << np.arange(8))[None]
    np.testing.assert_array_equal(boxes, (crossed * bits).sum(axis=1))
    np.testing.assert_array_equal(lowest, np.where(crossed.any(axis=1), crossed.argmax(axis=1), 30))

    rows = np.arange(count)
    i, j = np.where(axis == 0, 1, 0), np.where(axis == 2, 1, 2)
    moved = corners - origin[:, None, :, None]
    k = moved[rows, :, axis]
    x, y = moved[rows, :, i] - shear[:, 0, None, None] * k, moved[rows, :, j] - shear[:, 1, None, None] * k
    pairs = ((2, 1), (0, 2), (1, 0))
    edge = np.stack([x[:, p] * y[:, q] - y[:, p] * x[:, q] for p, q in pairs], axis=1)
    total = np.abs(x[:, 0]) + np.abs(y[:, 0])
    for corner in (1, 2):
        total = total + np.abs(x[:, corner]) + np.abs(y[:, corner])
    band = margin * (total + margin)
    ahead = (k * np.sign(towards[rows, axis])[:, None, None]).max(axis=1) >= -margin
    kept = ((edge.min(axis=1) >= -band) | (edge.max(axis=1) <= band)) & ahead
    np.testing.assert_array_equal(triangles, (kept * bits).sum(axis=1))
    assert not ahead.all()
    assert not kept[:, 6].any()


@pytest.mark.parametrize("threads", [1, 2])
@pytest.mark.parametrize(
    "light",
    [DirectionalLight((0.35, 0.9, 0.25)), PointLight((0.2, 0.6, 0.1)), SpotLight((1.5, 5.0, 1.0), (-0.3, -1.0, -0.2))],
    ids=["directional", "point", "spot"],
)
def test_offset_rays_start_off_the_surface_on_the_lights_side_and_end_at_the_light(light, threads):
    rng = np.random.default_rng(9)
    world = world_of(soup(300, rng), lights={"light": light})
    receivers = scattered_receivers(world, 2000, rng)
    placed = world.lights["light"]
    rays = OffsetRays(receivers, placed, 0.01, Context(threads=threads))
    x, y, z, w = homogeneous(placed)
    to_light = np.array([x, y, z]) - w * receivers.position.astype(np.float64)
    side = np.where((receivers.normal * to_light).sum(axis=1) < 0.0, -1.0, 1.0)
    origin = (receivers.position + (0.01 * side)[:, None] * receivers.normal.astype(np.float64)).astype(np.float32)
    np.testing.assert_array_equal(rays.origin.numpy(), origin)
    assert set(side) == {-1.0, 1.0}
    towards = (np.array([x, y, z]) - w * origin.astype(np.float64)).astype(np.float32)
    np.testing.assert_array_equal(rays.towards.numpy(), towards)
    reach = rays.reach.numpy()
    assert np.isinf(reach).all() if w == 0.0 else ((reach < 1.0) & (reach > 0.999999)).all()


def test_offset_rays_stop_at_the_lights_near_plane():
    world = world_of(soup(10, np.random.default_rng(10)), lights={"lamp": PointLight((0.0, 4.0, 0.0), near=1.0)})
    receivers = receivers_at(world, np.array([10]), np.full((1, 3), 1.0 / 3.0))
    rays = OffsetRays(receivers, world.lights["lamp"], 0.0, CONTEXT)
    assert rays.reach.numpy()[0] == pytest.approx(0.75, abs=1e-6)
