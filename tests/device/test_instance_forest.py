"""A forest of instances answers as the flat tree does, bit for bit."""

from dataclasses import replace

import numpy as np
import pytest
import warp as wp
from surfaces import scattered_receivers, soup

from shadowbench.device.instance_forest import InstanceForest, can_be_forest, tree_over
from shadowbench.device.instance_forest_kernels import Forest, is_blocked_in_forest, nearest_in_forest
from shadowbench.device.launch import Context, kernel_options, launch
from shadowbench.device.rays import is_blocked, make_ray, nearest_blocker
from shadowbench.device.triangle_tree import TriangleTree
from shadowbench.device.triangle_tree_kernels import Tree
from shadowbench.device.visibility import plane_tolerance
from shadowbench.scene import Camera, DirectionalLight, Instance, Mesh, Rotation, Scene
from shadowbench.world import place

wp.set_module_options(kernel_options(native=True))


@wp.kernel
def trace_flat(
    first: wp.int32,
    tree: Tree,
    tolerance: wp.float64,
    origin: wp.array[wp.vec3],
    towards: wp.array[wp.vec3d],
    reach: wp.float64,
    blocked: wp.array[wp.int32],
    blocker: wp.array[wp.int32],
    parameter: wp.array[wp.float64],
):
    i = wp.tid() + first
    ray = make_ray(origin[i], towards[i], reach, tolerance)
    blocked[i] = wp.int32(is_blocked(tree, ray))
    found, t = nearest_blocker(tree, ray)
    blocker[i] = found
    parameter[i] = t


@wp.kernel
def trace_forest(
    first: wp.int32,
    forest: Forest,
    tolerance: wp.float64,
    origin: wp.array[wp.vec3],
    towards: wp.array[wp.vec3d],
    reach: wp.float64,
    blocked: wp.array[wp.int32],
    blocker: wp.array[wp.int32],
    parameter: wp.array[wp.float64],
):
    i = wp.tid() + first
    ray = make_ray(origin[i], towards[i], reach, tolerance)
    blocked[i] = wp.int32(is_blocked_in_forest(forest, ray))
    found, t = nearest_in_forest(forest, ray)
    blocker[i] = found
    parameter[i] = t


def answers(casters, tree, origin, towards, reach, tolerance):
    """Whether each ray is blocked, by what, and where."""
    count = len(origin)
    outputs = [wp.empty(count, dtype=kind, device="cpu") for kind in (wp.int32, wp.int32, wp.float64)]
    rays = [wp.array(origin, dtype=wp.vec3, device="cpu"), wp.array(towards, dtype=wp.vec3d, device="cpu")]
    tree.build(casters)
    kernel = trace_forest if isinstance(tree, InstanceForest) else trace_flat
    launch(kernel, count, [tree.packed(), tolerance, *rays, reach], outputs, context=tree.context)
    return [output.numpy().copy() for output in outputs]


def forest_scene(rng, count=60, *, size=1.0, offset=(0.0, 0.0, 0.0), stretch=3.0):
    """Instances of two soups, one of them modelled far from its origin; turned, stretched, mirrored and doubled."""
    near, of_near = soup(60, rng)
    far, of_far = soup(300, rng)
    meshes = (
        Mesh("near", near, of_near),
        Mesh("far", 0.3 * (far.astype(np.float64) + np.array([40.0, -3.0, 7.0])), of_far),
    )
    instances = []
    for k in range(count):
        axis = tuple(float(x) for x in rng.normal(size=3))
        scale = stretch ** rng.uniform(-1.0, 1.0, 3) * np.where(rng.random(3) < 0.3, -1.0, 1.0) * size
        place_at = rng.uniform(-8.0, 8.0, 3) * (1.0, 0.3, 1.0) * size + offset
        instances.append(
            Instance(
                k % 2,
                tuple(float(x) for x in place_at),
                tuple(float(s) for s in scale),
                Rotation(axis, float(rng.uniform(0.0, 360.0)) if k % 5 else 90.0 * k),
            )
        )
    instances += [instances[3], instances[4], replace(instances[4], casts=False), Instance(0)]
    return Scene(
        meshes, tuple(instances), {"sun": DirectionalLight((0.2, 1.0, 0.3))}, {"c": Camera((0, 3, 4), (0, 0, 0))}
    )


def both(scene):
    """The world of a scene, streamed and flat."""
    return place(scene, copied_triangles=0), place(scene, copied_triangles=10**9)


def assert_equal_answers(scene, rng, count=3000, threads=1):
    """Rays of all kinds from points on surfaces; returns the share that is blocked."""
    world, flat = both(scene)
    origin = scattered_receivers(flat, count, rng, on_edges=0.4).position
    context = Context(threads=threads)
    forest = tree_over(world.casters, context)
    assert isinstance(forest, InstanceForest)
    assert isinstance(tree_over(flat.casters, context), TriangleTree)
    targets = flat.vertices[rng.integers(0, len(flat.vertices), count)].astype(np.float64)
    parallel = np.broadcast_to(rng.normal(size=3), (count, 3))
    axes = np.eye(3)[rng.integers(0, 3, count)] * rng.choice([-1.0, 1.0], (count, 1))
    tolerance = plane_tolerance(world.scale)
    shares = []
    for towards, reach in ((parallel, np.inf), (axes, np.inf), (targets - origin, np.inf), (targets - origin, 1.0)):
        moving = np.abs(towards).max(axis=1) > 0.0
        rays = origin[moving], np.ascontiguousarray(towards[moving]), reach, tolerance
        expected = answers(flat.casters, TriangleTree(flat.casters.triangle_count, context), *rays)
        found = answers(world.casters, forest, *rays)
        for one, other in zip(found, expected, strict=True):
            np.testing.assert_array_equal(one, other)
        shares.append(expected[0].mean())
    assert "_flattened" not in world.__dict__ | world.casters.__dict__
    return shares


@pytest.mark.parametrize("threads", [1, 2])
def test_rays_through_instances_cross_what_rays_through_flat_triangles_cross(threads):
    rng = np.random.default_rng(1)
    assert min(assert_equal_answers(forest_scene(rng), rng, threads=threads)) > 0.05


@pytest.mark.parametrize(
    ("size", "offset"),
    [(1e-6, (0, 0, 0)), (1e5, (0, 0, 0)), (1.0, (1e4, -2e4, 3e4)), (3e-3, (1.0, 2.0, 3.0))],
    ids=["small", "large", "far", "small and far"],
)
def test_in_any_unit_and_anywhere(size, offset):
    rng = np.random.default_rng(2)
    scene = forest_scene(rng, size=size, offset=offset)
    scene = replace(scene, instances=scene.instances[:-1])  # the last one lies at the origin in its own size
    assert min(assert_equal_answers(scene, rng, 1500)) > 0.05


def test_instances_stretched_a_thousandfold():
    rng = np.random.default_rng(3)
    assert min(assert_equal_answers(forest_scene(rng, stretch=1000.0), rng, 1500)) > 0.05


def test_of_equally_near_triangles_of_two_instances_the_lowest_number_is_the_blocker():
    roof = Mesh("roof", np.array([[-1, 1, -1], [1, 1, -1], [0, 1, 1]], np.float32), np.array([[0, 1, 2], [0, 1, 2]]))
    instances = (Instance(0, (0.0, 1.0, 0.0)), *(Instance(0, scale=(s, 1.0, s)) for s in (1.0, 2.0, 3.0, 1.0)))
    lights, cameras = {"sun": DirectionalLight((0.0, 1.0, 0.0))}, {"c": Camera((0, 3, 4), (0, 0, 0))}
    casters = place(Scene((roof,), instances, lights, cameras), copied_triangles=0).casters
    forest = InstanceForest(Context())
    blocked, blocker, t = answers(casters, forest, np.zeros((1, 3)), np.array([[0.0, 1.0, 0.0]]), np.inf, 0.0)
    assert (blocked[0], blocker[0], t[0]) == (1, 2, 1.0)


def test_when_instances_move_only_the_tree_over_them_is_built_again():
    rng = np.random.default_rng(4)
    world, _ = both(forest_scene(rng))
    moved = {k: replace(world.authored[k], translation=(0.1 * k, 0.2, -0.3)) for k in (0, 7)}
    after = world.moved(moved)
    forest, fresh = InstanceForest(Context()), InstanceForest(Context())
    forest.build(world.casters)
    bounds = forest.bounds
    origin = rng.uniform(-8.0, 8.0, (800, 3)).astype(np.float32)
    rays = origin, rng.normal(size=(800, 3)), np.inf, 0.0
    found, expected = answers(after.casters, forest, *rays), answers(after.casters, fresh, *rays)
    assert forest.bounds is bounds
    for one, other in zip(found, expected, strict=True):
        np.testing.assert_array_equal(one, other)


def test_extreme_matrices_are_left_to_the_flat_tree():
    rng = np.random.default_rng(5)
    scene = forest_scene(rng, 6)
    for scale in ((1e-9, 1.0, 1.0), (1e-12, 1e-12, 1e3)):
        casters = place(
            replace(scene, instances=(*scene.instances, Instance(0, scale=scale))), copied_triangles=0
        ).casters
        assert not can_be_forest(casters)
        assert isinstance(tree_over(casters, Context()), TriangleTree)
