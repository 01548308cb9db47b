"""Translucent casters under the exact methods: each crossing dims by its caster's transmittance, and counts
once, also where triangles share an edge or a vertex."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from builders import box, square
from irregular import LIGHTS, differing, light_through, shaded_in_colour
from surfaces import grid, receivers_at, scattered_receivers, soup, sphere, world_of
from tracing import shaded

from shadowbench.device.launch import Context
from shadowbench.methods.afsm import AliasFreeShadowMaps
from shadowbench.methods.irregular_z_buffer import IrregularZBuffer
from shadowbench.methods.ray_traced import RayTraced
from shadowbench.reference import hard_reference
from shadowbench.scene import Camera, DirectionalLight, Instance, Mesh, PointLight, Scene
from shadowbench.world import place

METHODS = {
    "afsm": lambda threads=1: AliasFreeShadowMaps(AliasFreeShadowMaps.Parameters(), Context(threads=threads)),
    "brute force": lambda threads=1: AliasFreeShadowMaps(
        AliasFreeShadowMaps.Parameters(traversal="brute-force"), Context(threads=threads)
    ),
    "irregular-z-buffer": lambda threads=1: IrregularZBuffer(IrregularZBuffer.Parameters(), Context(threads=threads)),
    "ray-traced": lambda threads=1: RayTraced(RayTraced.Parameters(), Context(threads=threads)),
}
AMBER = (0.8, 0.5, 0.25)
HALF = (0.5, 0.5, 0.5)
NOTHING = (0.0, 0.0, 0.0)


def scene_of(*parts, lights=LIGHTS):
    """A world of meshes with a transmittance each."""
    return place(
        Scene(
            meshes=tuple(
                Mesh(f"mesh {k}", np.asarray(v, np.float32), f.astype(np.int32)) for k, ((v, f), _) in enumerate(parts)
            ),
            instances=tuple(Instance(k, transmittance=t) for k, (_, t) in enumerate(parts)),
            lights=lights,
            cameras={"front": Camera((0.3, 3.0, 4.0), (0.0, 0.0, 0.0))},
        )
    )


def mixed_soups():
    """Soups of glass in two colours and of opaque triangles, on a ground."""
    rng = np.random.default_rng(8)
    amber, blue, opaque = (soup(n, rng, area=2.0) for n in (60, 40, 10))
    world = scene_of((amber, AMBER), (opaque, NOTHING), (blue, (0.3, 0.6, 0.9)))
    return world, scattered_receivers(world, 1500, rng, on_edges=0.2)


def on_ground(world, places):
    """Receivers at places (x, z) on the world's first mesh, a square of half width 8 in the plane y = 0."""
    x, z = np.asarray(places, np.float64).T
    u, v = (x + 8.0) / 16.0, (z + 8.0) / 16.0
    first = v >= u  # triangles (-8, -8), (-8, 8), (8, 8) and (-8, -8), (8, 8), (8, -8)
    barycentric = np.where(first[:, None], np.stack([1.0 - v, v - u, u], axis=1), np.stack([1.0 - u, v, u - v], axis=1))
    receivers = receivers_at(world, np.where(first, 0, 1), barycentric)
    np.testing.assert_array_equal(receivers.position[:, [0, 2]], np.asarray(places, np.float32))
    return receivers


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("light", LIGHTS)
def test_visibility_is_the_product_of_what_the_crossed_triangles_let_through(method, light):
    world, receivers = mixed_soups()
    visibility, _ = shaded_in_colour(METHODS[method](), world, world.lights[light], receivers)
    through, touches_edge = light_through(world, receivers, world.lights[light])
    assert touches_edge.mean() < 0.05
    np.testing.assert_allclose(visibility[~touches_edge], through[~touches_edge], rtol=1e-6, atol=0.0)


@pytest.mark.parametrize("light", LIGHTS)
def test_all_methods_agree_with_the_ground_truth_to_the_bit(light):
    world, receivers = mixed_soups()
    truth = hard_reference(world, receivers, world.lights[light], Context())
    for method in METHODS.values():
        result, _ = shaded_in_colour(method(), world, world.lights[light], receivers)
        np.testing.assert_array_equal(result, truth.visibility)


@pytest.mark.parametrize("method", METHODS)
def test_bits_and_counters_do_not_depend_on_the_number_of_threads(method):
    world, receivers = mixed_soups()
    for light in ("directional", "point inside"):
        one, counted_by_one = shaded_in_colour(METHODS[method](1), world, world.lights[light], receivers)
        three, counted_by_three = shaded_in_colour(METHODS[method](3), world, world.lights[light], receivers)
        np.testing.assert_array_equal(one, three)
        assert counted_by_one.counters == counted_by_three.counters


@pytest.mark.parametrize("method", METHODS)
def test_the_order_of_triangles_changes_no_more_than_rounding(method):
    (vertices, triangles) = soup(200, np.random.default_rng(3), area=8.0)
    forwards = scene_of((square(2.0), HALF), ((vertices, triangles), AMBER))
    backwards = scene_of((square(2.0), HALF), ((vertices, triangles[::-1]), AMBER))
    receivers = on_square(forwards)
    light = forwards.lights["directional"]
    first, _ = shaded_in_colour(METHODS[method](), forwards, light, receivers)
    second, _ = shaded_in_colour(METHODS[method](), backwards, light, receivers)
    np.testing.assert_allclose(first, second, rtol=1e-6)
    assert len(np.unique(first)) > 10


def on_square(world):
    rng = np.random.default_rng(4)
    return receivers_at(world, rng.integers(0, 2, 2000), rng.dirichlet((1.0, 1.0, 1.0), 2000))


def dyadic_lattice(half, step):
    """Places whose coordinates float32 holds exactly."""
    line = np.arange(-half, half + step / 2, step)
    return np.stack(np.meshgrid(line, line), axis=-1).reshape(-1, 2)


@pytest.mark.parametrize("method", METHODS)
def test_a_closed_box_dims_twice_everywhere_inside_its_silhouette(method):
    """Under the zenith, on every edge, diagonal and corner of its faces too: the lattice holds them all."""
    world = scene_of((square(8.0), NOTHING), (box((-1.0, 1.0, -1.0), (1.0, 2.0, 1.0)), HALF))
    places = dyadic_lattice(2.0, 0.125)
    visibility, _ = shaded_in_colour(METHODS[method](), world, world.lights["overhead"], on_ground(world, places))
    farthest = np.abs(places).max(axis=1)
    assert (visibility[farthest < 1.0] == 0.25).all()
    assert (visibility[farthest > 1.0] == 1.0).all()
    assert np.isin(visibility[farthest == 1.0], (0.25, 1.0)).all()  # the silhouette itself: both faces or neither
    np.testing.assert_array_equal(visibility[:, 0], visibility[:, 2])


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("light", ["directional", "spot", "point far away", "grazing"])
def test_a_closed_sphere_dims_twice_or_not_at_all(method, light):
    world = scene_of((square(8.0), NOTHING), (sphere(2, np.array([0.0, 1.5, 0.0]), 1.0), HALF))
    rng = np.random.default_rng(6)
    receivers = on_ground(world, np.round(rng.uniform(-7.0, 7.0, (4000, 2)) * 1024.0) / 1024.0)
    visibility, _ = shaded_in_colour(METHODS[method](), world, world.lights[light], receivers)
    assert set(np.unique(visibility)) <= {0.0, 0.25, 1.0}
    assert (visibility == 0.25).any() or light == "grazing"


def bumpy_sheet():
    """A sheet with saddles and peaks at random heights 2 and 3 over a grid of step 1/4."""
    vertices, triangles = grid(16, 2.0)
    vertices[:, 1] = np.random.default_rng(7).integers(2, 4, len(vertices))
    return vertices, triangles


@pytest.mark.parametrize("method", METHODS)
def test_a_ray_through_a_vertex_or_edge_of_a_sheet_is_dimmed_once(method):
    """Seen from above, or from a lamp, from which the rays through the vertices meet the ground in exact places."""
    sheet, on_sheet = bumpy_sheet()
    lamp = np.array([0.125, 4.0, -0.125])
    lights = {"above": DirectionalLight((0.0, 1.0, 0.0)), "lamp": PointLight(tuple(lamp))}
    world = scene_of((square(8.0), NOTHING), ((sheet, on_sheet), HALF), lights=lights)
    inner = sheet[np.abs(sheet[:, [0, 2]]).max(axis=1) < 1.0]
    places = np.concatenate([inner[:, [0, 2]], dyadic_lattice(1.75, 0.0625)])
    visibility, _ = shaded_in_colour(METHODS[method](), world, lights["above"], on_ground(world, places))
    assert (visibility == 0.5).all()
    # from the lamp at height 4, a vertex at height 2 is half way to the ground, one at 3 a quarter
    times = np.where(inner[:, 1] == 2.0, 2.0, 4.0)[:, None]
    places = (lamp + times * (inner - lamp))[:, [0, 2]]
    places = places[np.abs(places).max(axis=1) < 3.5]
    assert len(places) > 30
    visibility, _ = shaded_in_colour(METHODS[method](), world, lights["lamp"], on_ground(world, places))
    layers = np.round(np.log2(1.0 / visibility[:, 0]))
    assert (layers % 2 == 1).all()  # a sheet between lamp and ground: an odd number of crossings, folds included


@pytest.mark.parametrize("method", METHODS)
def test_opaque_casters_shadow_as_in_the_ground_truth_when_others_let_all_light_through(method):
    rng = np.random.default_rng(11)
    opaque, glass = soup(60, rng), soup(60, rng)
    world = scene_of((opaque, NOTHING), (glass, (1.0, 1.0, 1.0)))
    receivers = scattered_receivers(scene_of((opaque, NOTHING)), 3000, rng, on_edges=0.5)
    alone = scene_of((opaque, NOTHING))
    alone = replace(alone, scale=world.scale)
    for light in ("directional", "point inside"):
        visibility, _ = shaded_in_colour(METHODS[method](), world, world.lights[light], receivers)
        truth, _ = shaded(METHODS[method](), alone, alone.lights[light], receivers)
        assert differing(METHODS[method](), alone, receivers, light)[0] == 0
        np.testing.assert_array_equal(visibility, np.repeat(truth[:, None], 3, axis=1))


@pytest.mark.parametrize("method", METHODS)
def test_without_channels_grey_casters_give_what_each_channel_gets(method):
    world = world_of(square(1.0), square(0.5, 1.0), lights=LIGHTS, transmittance=(0.7, 0.7, 0.7))
    receivers = scattered_receivers(world, 500, np.random.default_rng(1))
    light = world.lights["overhead"]
    grey, _ = shaded(METHODS[method](), world, light, receivers)
    colour, _ = shaded_in_colour(METHODS[method](), world, light, receivers)
    np.testing.assert_array_equal(np.repeat(grey[:, None], 3, axis=1), colour)
    assert set(np.unique(grey)) == {np.float32(0.7), np.float32(1.0)}


def test_one_object_shades_opaque_and_translucent_frames_in_turn():
    rng = np.random.default_rng(12)
    opaque, glass = scene_of((soup(60, rng), NOTHING)), scene_of((soup(60, rng), HALF))
    shader = METHODS["irregular-z-buffer"]()
    for world in (opaque, glass, opaque, glass):
        receivers = scattered_receivers(world, 800, np.random.default_rng(13))
        light = world.lights["directional"]
        again, _ = shaded_in_colour(shader, world, light, receivers)
        anew, _ = shaded_in_colour(METHODS["irregular-z-buffer"](), world, light, receivers)
        np.testing.assert_array_equal(again, anew)


def test_many_neighbouring_instances_of_different_glass_multiply_in_the_order_of_the_file():
    """More colours than rays are counted by at a time, in float32 whose products depend on their order."""
    rng = np.random.default_rng(14)
    panes = [(square(2.0, 0.1 + 0.01 * k), tuple(rng.uniform(0.6, 1.0, 3))) for k in range(40)]
    world = scene_of((square(4.0), NOTHING), *panes)
    receivers = on_ground(scene_of((square(8.0), NOTHING)), dyadic_lattice(0.5, 0.25))
    light = world.lights["overhead"]
    truth = hard_reference(world, receivers, light, Context()).visibility
    product = np.ones(3, np.float32)
    for _, transmittance in panes:
        product *= np.array(transmittance, np.float32)
    np.testing.assert_array_equal(truth, np.tile(product, (receivers.count, 1)))
    for method in METHODS.values():
        np.testing.assert_array_equal(shaded_in_colour(method(), world, light, receivers)[0], truth)


def test_a_surface_turned_away_is_dark_however_clear_it_is():
    world = scene_of((square(1.0), (0.9, 0.9, 0.9)), lights={"below": DirectionalLight((0.0, -1.0, 0.0))})
    receivers = on_square(world)
    truth = hard_reference(world, receivers, world.lights["below"], Context())
    assert truth.turned_away.all()
    assert not truth.visibility.any()
    for method in METHODS.values():
        assert not shaded_in_colour(method(), world, world.lights["below"], receivers)[0].any()
