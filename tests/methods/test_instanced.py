"""Instanced shadow maps: windows, sharing, reuse, the union over casters, and other techniques as oracles."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from builders import box, flat_receivers, square
from instancing import CAMERA, LIGHTS, built, copse, made, result, seen, shaded, turned, world_of_instances
from running import REGISTRY, run_method
from surfaces import grid, sphere

from shadowbench.device.launch import Context
from shadowbench.errors import ParameterError
from shadowbench.light_picture import CAPTION, SIDE, depth_sheet
from shadowbench.light_space import axes_of
from shadowbench.reference import hard_reference
from shadowbench.scene import Camera, Instance, Mesh, PointLight, Rotation, Scene
from shadowbench.world import place

POST = box((-0.3, 0.0, -0.2), (0.3, 1.4, 0.25))


def _failures(world, receivers, light, visibility):
    """Scored receivers on the wrong side, in percent."""
    truth = hard_reference(world, receivers, world.lights[light], Context(threads=2))
    scored = receivers.valid & truth.in_field & ~truth.turned_away
    return 100.0 * (((visibility >= 0.5) != (truth.visibility >= 0.5)) & scored).sum() / scored.sum()


def _joined(*parts):
    vertices = np.concatenate([v for v, _ in parts])
    offsets = np.cumsum([0, *(len(v) for v, _ in parts)])
    return vertices, np.concatenate([t + offset for (_, t), offset in zip(parts, offsets, strict=False)]).astype(
        np.int32
    )


def _room():
    """Things on a floor whose bounding box has all its corners, as specks: its window is the world's."""
    specks = [
        box(low, tuple(np.add(low, 1e-3)))
        for low in np.array(np.meshgrid((-2, 1.999), (0, 1.999), (-2, 1.999))).T.reshape(-1, 3)
    ]
    things = [box((-1.2, 0.0, -0.9), (-0.5, 1.3, 0.1)), sphere(3, np.array((0.6, 0.8, 0.3)), 0.5)]
    return _joined(grid(6, 2.0), *things, *specks)


# --- one caster


@pytest.mark.parametrize("light", ["sun", "overhead"])
def test_one_translated_instance_with_the_same_texels_is_the_plain_shadow_map(light):
    vertices, triangles = _room()
    world = place(
        Scene(
            (Mesh("room", vertices.astype(np.float32), triangles),),
            (Instance(0, (0.37, -0.21, 1.13)),),
            LIGHTS,
            {"front": Camera((2.5, 4.0, 7.0), (0.4, 0.4, 1.0))},
        )
    )
    receivers = seen(world, 320, 240)
    for values in ({"bias": 1e-3, "slope_bias": 0.0}, {"bias": 1e-4, "slope_bias": 1.0}):
        plain, plain_trace = run_method("shadow-map", world, receivers, light=light, resolution=200, **values)
        own, trace = result(world, receivers, light, resolution=200, **values)
        mine = trace.kept["shadow maps"].numpy().reshape(200, 200) * 1024.0  # its far plane is at 1/1024
        theirs = plain_trace.kept["shadow map"].numpy()[0]
        filled = theirs < 1.0
        # the world's float32 vertices are the mesh's, moved and rounded
        assert (np.abs(mine - theirs)[filled] < 1e-5).mean() > 0.999
        assert (own != plain).mean() < 1e-3
        assert 0.2 < plain.mean() < 0.97


@pytest.mark.parametrize("light", ["sun", "spot", "lamp"])
def test_the_map_is_fitted_to_the_caster_which_fails_less_than_one_map_of_the_scene(light):
    world = world_of_instances(POST, [turned(20.0)], ground=12.0)
    receivers = seen(world, 320, 240)
    own, trace = result(world, receivers, light, resolution=128, rotation="exact")
    plain, _ = run_method("shadow-map", world, receivers, light=light, resolution=128)
    assert trace.counters["maps built"] == len(trace.kept["shadow maps"].numpy()) / 128**2
    assert _failures(world, receivers, light, own) < 0.4 * _failures(world, receivers, light, plain)


@pytest.mark.parametrize("light", ["sun", "spot"])
def test_the_caster_fills_its_map_up_to_the_margin(light):
    world = world_of_instances(box((-0.5, 0.0, -0.5), (0.5, 1.0, 0.5)), [turned(0.0, size=0.7, x=0.4)])
    _, trace = result(world, seen(world), light, resolution=256)
    filled = trace.kept["shadow maps"].numpy().reshape(256, 256) < 1.0
    for axis in (0, 1):
        lines = np.flatnonzero(filled.any(axis=axis))
        assert lines[0] <= 1
        assert lines[-1] >= 254


def test_failures_fall_with_the_resolution():
    world = copse(instances=4, triangles=800, angle=17.0)
    receivers = seen(world, 320, 240)
    failures = []
    for resolution in (64, 256, 1024):
        visibility, _ = result(world, receivers, resolution=resolution, rotation="exact", threads=2)
        failures.append(_failures(world, receivers, "sun", visibility))
    assert failures[0] > 2.0 * failures[1] > 4.0 * failures[2]


@pytest.mark.parametrize("light", ["sun", "lamp"])
def test_a_world_far_from_the_origin_has_the_shadows_it_has_at_the_origin(light):
    shift = np.array((2.0**20, 2.0**22, -(2.0**21)))
    instances = [turned(20.0, x=-1.0, z=0.25), turned(75.0, x=1.0)]
    near = world_of_instances(POST, instances)
    lamp = PointLight(tuple(shift + LIGHTS["lamp"].position))
    moved = tuple(replace(i, translation=tuple(shift + i.translation)) for i in (Instance(0, casts=False), *instances))
    camera = replace(CAMERA, eye=tuple(shift + CAMERA.eye), target=tuple(shift + CAMERA.target))
    far = place(Scene(near.meshes, moved, LIGHTS | {"lamp": lamp}, {"front": camera}))
    assert far.origin == tuple(shift)
    for values in ({}, {"rotation": "exact", "resolution": 128}):
        here, trace = result(near, seen(near), light, **values)
        there, other = result(far, seen(far), light, **values)
        np.testing.assert_array_equal(here, there)
        assert trace.counters == other.counters


def test_a_light_among_the_casters_shadows_by_every_face_it_reaches():
    """A lamp within the object's box: its six maps share the object out."""
    legs = [box((x, 0.0, z), (x + 0.2, 1.5, z + 0.2)) for x in (-0.8, 0.6) for z in (-0.8, 0.6)]
    world = world_of_instances(_joined(*legs), [turned(33.0, x=0.1)])
    world.lights["within"] = PointLight((0.13, 0.7, 0.05))
    receivers = seen(world, 320, 240)
    visibility, trace = result(world, receivers, "within", resolution=256)
    assert trace.counters["maps built"] == 6
    assert trace.counters["fill"] == receivers.count
    assert _failures(world, receivers, "within", visibility) < 1.0
    assert (visibility == 0.0).mean() > 0.05


# --- sharing and reuse


def _scattered(angles, rng, **more):
    return [
        turned(a, x=x, z=z, size=rng.uniform(0.5, 1.3), **more)
        for a, x, z in zip(angles, *rng.uniform(-2.5, 2.5, (2, len(angles))), strict=True)
    ]


def test_twelve_maps_of_512_texels_keep_exactly_12582912_bytes():
    rng = np.random.default_rng(1)
    angles = np.concatenate([np.arange(12) * 30.0 + 11.0, rng.uniform(0.0, 360.0, 93)])
    world = world_of_instances(POST, _scattered(angles, rng))
    _, trace = result(world, seen(world))
    assert trace.bytes_by_name() == {"shadow maps": 12_582_912}
    assert trace.counters["maps built"] == 12
    assert trace.counters["triangles drawn"] == 12 * 12


def test_instances_that_differ_by_translation_and_scale_share_one_map_under_the_sun_only():
    rng = np.random.default_rng(2)
    world = world_of_instances(POST, _scattered([0.0] * 6, rng))
    receivers = seen(world)
    for light, maps in (("sun", 1), ("spot", 6)):
        visibility, trace = result(world, receivers, light, resolution=256)
        assert trace.counters["maps built"] == maps
        assert _failures(world, receivers, light, visibility) < 0.5


def test_scale_along_one_axis_or_a_mirror_takes_a_map_of_its_own():
    scales = [(1.0, 1.0, 1.0), (2.0, 2.0, 2.0), (1.0, 0.5, 1.0), (2.0, 1.0, 2.0), (-1.0, 1.0, 1.0)]
    instances = [Instance(1, (-2.0 + k, 0.0, 0.0), s) for k, s in enumerate(scales)]
    wedge = _joined(POST, box((0.3, 0.0, 0.0), (0.6, 0.4, 0.2)))
    world = world_of_instances(wedge, instances)
    receivers = seen(world)
    visibility, trace = result(world, receivers, resolution=512)
    assert trace.counters["maps built"] == 3
    assert _failures(world, receivers, "sun", visibility) < 0.5


def test_nothing_is_built_again_while_nothing_relevant_moves():
    world = world_of_instances(POST, [turned(10.0, x=-1.0), turned(100.0, x=1.0)])
    receivers = seen(world)
    method = made(resolution=64)
    none = frozenset()
    assert built(method, world, receivers).counters["maps built"] == 4
    first, _ = shaded(method, receivers)
    assert built(method, world, receivers, changed=(False, none, True)).counters["maps built"] == 0
    assert built(method, world, receivers, changed=(False, none, False)).counters["triangles drawn"] == 0
    again, _ = shaded(method, receivers)
    np.testing.assert_array_equal(first, again)
    assert built(method, world, receivers, changed=(True, None, False)).counters["maps built"] == 4


def test_the_report_gets_one_picture_of_all_maps_with_their_angles():
    world = world_of_instances(POST, [turned(70.0, x=-1.0), turned(70.0, x=1.0), turned(340.0, z=1.0)])
    receivers = seen(world)
    method = made(resolution=64)
    built(method, world, receivers)
    _, trace = shaded(method, receivers)
    pool, requests = method._drawer.pool, method._pairs.requests
    by_angle = {request.rotation.angle: pool.map(key).numpy() for key, request in requests.items()}
    angles = (0.0, 60.0, 90.0, 330.0)
    assert sorted(by_angle) == list(angles)
    expected = depth_sheet([(f"object {angle:g}\u00b0", by_angle[angle]) for angle in angles])
    np.testing.assert_array_equal(trace.pictures["depth map"], expected)


@pytest.mark.parametrize(("light", "name"), [("spot", "object, caster 0"), ("lamp", "object, caster 0 -y")])
def test_under_a_light_from_a_place_maps_are_named_by_their_caster(light, name):
    world = world_of_instances(POST, [turned(0.0, x=0.9, z=0.7, size=0.5)])
    receivers = seen(world)
    method = made(resolution=64)
    built(method, world, receivers, light)
    _, trace = shaded(method, receivers)
    ((key, _),) = method._pairs.requests.items()
    expected = depth_sheet([(name, method._drawer.pool.map(key).numpy())])
    np.testing.assert_array_equal(trace.pictures["depth map"], expected)


def test_of_very_many_maps_some_are_pictured_and_the_others_counted():
    world = world_of_instances(POST, [turned(float(angle), x=angle / 60.0 - 3.0) for angle in range(1, 361, 9)])
    receivers = seen(world)
    method = made(resolution=16, rotation="exact")
    assert built(method, world, receivers).counters["maps built"] == 40
    _, trace = shaded(method, receivers)
    side = SIDE // 5
    assert trace.pictures["depth map"].shape == (5 * (side + CAPTION) + CAPTION, SIDE, 3)


def test_a_caster_that_is_moved_needs_no_new_map_and_one_that_is_turned_needs_those_of_its_angle():
    post = Mesh("post", *POST)

    def world(x, angle):
        return world_of_instances(post, [turned(0.0, x=-1.0), turned(angle, x=x)])

    receivers = seen(world(1.0, 60.0))
    method = made(resolution=64)
    built(method, world(1.0, 60.0), receivers)
    # between 30 and 60 degrees a second map comes; at 330 both go and one comes
    for placed, drawn, kept in ((world(1.4, 60.0), 0, 2), (world(1.4, 50.0), 1, 3), (world(1.0, 330.0), 1, 2)):
        trace = built(method, placed, receivers, changed=(False, frozenset({1}), False))
        assert trace.counters["maps built"] == drawn
        assert trace.counters["map texels"] == kept * 64**2
        fresh, _ = result(placed, receivers, resolution=64)
        reused, _ = shaded(method, receivers)
        np.testing.assert_array_equal(reused, fresh)


def test_a_mesh_that_changed_is_drawn_again_and_others_are_not():
    world = world_of_instances(POST, [turned(0.0, x=-1.0)])
    other = Mesh("other", *box((-0.2, 0.0, -0.2), (0.2, 0.8, 0.2)))
    world = place(
        Scene((*world.meshes, other), (*world.instances, Instance(2, (1.0, 0.0, 0.0))), LIGHTS, world.cameras)
    )
    receivers = seen(world)
    method = made(resolution=64)
    assert built(method, world, receivers).counters["maps built"] == 2
    lower = replace(other, vertices=other.vertices * np.float32(0.5), version=1)
    changed = place(Scene((*world.meshes[:2], lower), world.instances, LIGHTS, world.cameras))
    trace = built(method, changed, receivers, changed=(False, frozenset({1}), False))
    assert trace.counters["maps built"] == 1
    fresh, _ = result(changed, receivers, resolution=64)
    np.testing.assert_array_equal(shaded(method, receivers)[0], fresh)


def test_a_map_by_importance_has_a_texel_for_a_pixel_of_its_largest_instance():
    world = world_of_instances(sphere(2, np.array((0.0, 0.6, 0.0)), 0.5), [turned(0.0), turned(0.0, x=2.0, size=0.25)])
    receivers = seen(world, 200, 150)
    _, trace = result(world, receivers, sizing="importance", resolution=2048)
    # the box's sphere has the radius √3/2 and is seen whole
    distance = np.linalg.norm(np.array(CAMERA.eye) - (0.0, 0.6, 0.0))
    tangent = np.sqrt(0.75 / (distance**2 - 0.75))
    pixels = 2.0 * tangent * 150 / (2.0 * np.tan(np.radians(22.5)))
    expected = 2 ** int(np.ceil(np.log2(pixels)))
    assert trace.kept["shadow maps"].size == expected**2
    _, smaller = result(world, receivers, sizing="importance", resolution=20)
    assert smaller.kept["shadow maps"].size == 20**2


def test_importance_belongs_to_every_frame_and_redraws_only_what_changes_its_size():
    near = world_of_instances(POST, [turned(0.0)])
    far = world_of_instances(POST, [turned(0.0)], camera=replace(CAMERA, eye=(6.0, 16.0, 28.0)))
    assert made(sizing="importance").is_view_dependent()
    assert not made().is_view_dependent()
    method = made(sizing="importance")
    assert built(method, near, seen(near)).counters["maps built"] == 1
    only_the_view = (False, frozenset(), True)
    assert built(method, near, seen(near), changed=only_the_view).counters["maps built"] == 0
    assert built(method, far, seen(far), changed=only_the_view).counters["maps built"] == 1
    fresh, _ = result(far, seen(far), sizing="importance")
    np.testing.assert_array_equal(shaded(method, seen(far))[0], fresh)


def test_maps_that_no_array_can_hold_are_refused_before_they_are_drawn():
    world = world_of_instances(POST, [turned(7.0 * k) for k in range(8)])
    with pytest.raises(ParameterError, match="8 maps take 2147483648 texels, but no more than 2147483647 can be kept"):
        built(made(rotation="exact", resolution=16384), world, seen(world))


# --- the union over casters


def _mixed_copse():
    """Overlapping shadows of opaque and coloured posts."""
    rng = np.random.default_rng(5)
    shades = [(0.0, 0.0, 0.0), (0.8, 0.5, 0.25), (0.3, 0.6, 0.9), (0.7, 0.7, 0.7)]
    return [
        turned(rng.uniform(0.0, 360.0), x=x, z=z, size=rng.uniform(0.6, 1.2), transmittance=shades[k % 4])
        for k, (x, z) in enumerate(rng.uniform(-0.7, 0.7, (24, 2)))
    ]


@pytest.mark.parametrize("rotation", ["interpolated-depth", "interpolated-result"])
@pytest.mark.parametrize("light", ["sun", "lamp"])
def test_the_union_over_casters_does_not_depend_on_their_order(light, rotation):
    instances = _mixed_copse()
    world = world_of_instances(POST, instances)
    receivers = flat_receivers(120, 120, extent=3.0)
    first, trace = result(world, receivers, light, channels=3, rotation=rotation, resolution=64)
    for seed in (1, 2):
        shuffled = [instances[k] for k in np.random.default_rng(seed).permutation(len(instances))]
        again, other = result(
            world_of_instances(POST, shuffled), receivers, light, channels=3, rotation=rotation, resolution=64
        )
        np.testing.assert_array_equal(first, again)
        assert trace.counters == other.counters
    assert len(np.unique(first)) > 20


@pytest.mark.parametrize("threads", [2, 5])
@pytest.mark.parametrize("application", ["volumes", "all-maps"])
def test_the_same_bits_come_out_for_every_number_of_threads(application, threads):
    world = world_of_instances(POST, _mixed_copse())
    receivers = seen(world)
    for light in ("sun", "lamp"):
        one, counted = result(world, receivers, light, channels=3, resolution=64, application=application)
        more, counted_by_more = result(
            world, receivers, light, channels=3, resolution=64, application=application, threads=threads
        )
        np.testing.assert_array_equal(one, more)
        assert counted.counters == counted_by_more.counters


def test_translucent_casters_multiply_by_channel_and_each_counts_once():
    """Two panes and a closed box, one above the other, under the zenith."""
    amber, blue = (0.8, 0.5, 0.25), (0.3, 0.6, 0.9)
    pane, on_pane = square(0.5, 1.0)
    meshes = (
        Mesh("ground", *square(4.0)),
        Mesh("pane", pane, on_pane),
        Mesh("box", *box((-0.5, 0.2, -0.5), (0.5, 0.6, 0.5))),
    )
    instances = (
        Instance(0, casts=False),
        Instance(1, (0.0, 0.0, 0.0), transmittance=amber),
        Instance(1, (0.5, 0.3, 0.0), transmittance=blue),
        Instance(2, (0.0, 0.0, 0.5), transmittance=(0.5, 0.5, 0.5)),
    )
    world = place(Scene(meshes, instances, LIGHTS, {"front": CAMERA}))
    receivers = flat_receivers(200, 200, extent=1.5)  # on the ground, also where the camera does not see it
    visibility, _ = result(world, receivers, "overhead", channels=3, resolution=512)
    x, _, z = receivers.position.astype(np.float64).T
    expected = np.ones((receivers.count, 3))
    clear = np.ones(receivers.count, bool)
    for low, high, transmittance in (
        ((-0.5, -0.5), (0.5, 0.5), amber),
        ((0.0, -0.5), (1.0, 0.5), blue),
        ((-0.5, 0.0), (0.5, 1.0), (0.5, 0.5, 0.5)),
    ):
        margin = np.minimum.reduce([x - low[0], high[0] - x, z - low[1], high[1] - z])
        expected[margin > 0.0] *= transmittance
        clear &= np.abs(margin) > 0.01
    np.testing.assert_allclose(visibility[clear], expected[clear], rtol=1e-6)
    assert len(np.unique(expected[clear][:, 0])) == 7
    grey, _ = result(world, receivers, "overhead", resolution=512)
    np.testing.assert_array_equal(grey, visibility[:, 0])


@pytest.mark.parametrize("light", ["sun", "lamp"])
def test_querying_every_map_finds_the_same_shadows_and_asks_every_caster(light):
    world = world_of_instances(POST, _scattered(np.arange(10) * 37.0, np.random.default_rng(7)))
    receivers = seen(world)
    values = {"resolution": 256, "rotation": "exact"}
    applied, trace = result(world, receivers, light, **values)
    queried, queried_trace = result(world, receivers, light, application="all-maps", **values)
    assert queried_trace.counters["look-ups"] == 10 * receivers.count
    assert trace.counters["look-ups"] < 0.1 * queried_trace.counters["look-ups"]
    # within a texel outside of a volume a map may find a shadow, and nowhere else
    np.testing.assert_array_equal(queried < applied, ~trace.masks["candidates"] & (queried < 1.0))
    assert (queried <= applied).all()
    assert (queried != applied).mean() < 0.01


def test_a_world_without_casters_is_lit():
    world = world_of_instances(POST, [turned(0.0, casts=False)])
    receivers = seen(world)
    for values in ({}, {"application": "all-maps"}, {"sizing": "importance"}):
        for light in ("sun", "spot", "lamp"):
            visibility, trace = result(world, receivers, light, **values)
            assert (visibility == 1.0).all()
            assert trace.bytes_by_name() == {"shadow maps": 0}


# --- any scene


@pytest.mark.parametrize("light", ["sun", "spot", "lamp"])
@pytest.mark.parametrize(
    ("scene", "values"),
    [
        ("random-triangles", {"triangles": 300}),
        ("bunny", {}),
        ("box-on-plane", {}),
        ("sphere-on-plane", {"subdivisions": 3}),
    ],
)
def test_scenes_of_one_object_fail_no_more_than_with_one_map_of_the_scene(scene, values, light):
    cls = REGISTRY.scene(scene)
    world = place(cls().make(cls.Parameters(**values)))
    if light not in world.lights:
        pytest.skip("the scene has no such light")
    receivers = seen(world)
    own, _ = result(world, receivers, light, resolution=512, threads=2)
    plain, _ = run_method("shadow-map", world, receivers, light=light, threads=2, resolution=512)
    assert _failures(world, receivers, light, own) <= _failures(world, receivers, light, plain) + 0.05


def test_the_ground_may_cast_and_is_not_asked_about_itself():
    world = place(
        Scene(
            (Mesh("ground", *square(4.0)), Mesh("post", *POST)),
            (Instance(0), Instance(1, (0.2, 0.0, 0.1), rotation=Rotation(angle=40.0))),
            LIGHTS,
            {"front": CAMERA},
        )
    )
    receivers = seen(world)
    for light in ("sun", "spot", "lamp"):
        visibility, trace = result(world, receivers, light, resolution=256, rotation="exact")
        assert _failures(world, receivers, light, visibility) < 0.3
        assert trace.heats["overdraw"][receivers.instance == 0].mean() < 0.5


def test_several_samples_and_layers_are_receivers_like_others():
    world = world_of_instances(POST, [turned(10.0), turned(70.0, x=1.0)])
    receivers = seen(world, 80, 60, samples=4, layers=2)
    visibility, _ = result(world, receivers, resolution=512, rotation="exact")
    assert _failures(world, receivers, "sun", visibility) < 0.5


def test_maps_are_drawn_with_the_light_as_the_mesh_sees_it():
    """The window's axes are those of any light's frame; a turned instance sees the light turned the other way."""
    sun = np.array(LIGHTS["sun"].direction) / np.linalg.norm(LIGHTS["sun"].direction)
    method = made(rotation="exact")
    world = world_of_instances(POST, [turned(30.0)])
    built(method, world, seen(world))
    (request,) = method._pairs.requests.values()
    cosine, sine = np.cos(np.radians(30.0)), np.sin(np.radians(30.0))
    in_mesh = np.array((cosine * sun[0] - sine * sun[2], sun[1], sine * sun[0] + cosine * sun[2]))
    for row, axis in zip(request.projection[:3, :3], axes_of(-in_mesh), strict=True):
        np.testing.assert_allclose(row / np.linalg.norm(row), axis, atol=1e-7)
