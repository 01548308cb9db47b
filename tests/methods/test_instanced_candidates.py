"""Candidates: every receiver that the ground truth says a caster shadows, wherever camera and light are."""

from __future__ import annotations

import numpy as np
import pytest
from builders import square
from instancing import built, made, shaded
from surfaces import soup

from shadowbench.camera_pass import render
from shadowbench.device.launch import Context
from shadowbench.errors import SceneError
from shadowbench.reference import hard_reference
from shadowbench.scene import Camera, DirectionalLight, Instance, Mesh, PointLight, Rotation, Scene, SpotLight
from shadowbench.world import place

VIEW_COUNT = 40

CAMERAS = ("anywhere", "inside the volume", "on the box", "on the volume's side")


def _random_mesh(rng):
    """Triangles in a box of any shape, now and then in a plane."""
    count = int(rng.integers(1, 30))
    centre = rng.uniform(-1.0, 1.0, (count, 3)) * rng.uniform(0.02, 1.0, 3)
    corners = (centre[:, None] + rng.normal(size=(count, 3, 3)) * rng.uniform(0.01, 0.5)).reshape(-1, 3)
    if rng.random() < 0.2:
        corners[:, rng.integers(3)] = rng.uniform(-1.0, 1.0)
    return Mesh("soup", corners.astype(np.float32), np.arange(3 * count, dtype=np.int32).reshape(-1, 3))


def _random_light(kind, rng):
    if kind == "sun":
        direction = rng.normal((0.0, 0.5, 0.0), 1.0)
        if rng.random() < 0.3:
            direction = np.eye(3)[rng.integers(3)] * rng.choice((-1.0, 1.0))
        return DirectionalLight(tuple(direction))
    near = None if rng.random() < 0.7 else float(rng.uniform(0.01, 0.5))
    position = rng.uniform((-2.0, -1.0, -2.0), (2.0, 3.0, 2.0))
    if kind == "lamp":
        return PointLight(tuple(position), near=near)
    return SpotLight(tuple(position), tuple(0.3 * rng.normal(size=3) - position), rng.uniform(20.0, 170.0), near=near)


def _random_eye(camera, mesh, instance, light, rng):
    """A place for the camera; those of the volume are a point of the box, moved away from the light."""
    if camera == "anywhere":
        return rng.uniform(-4.0, 4.0, 3)
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    in_box = rng.uniform(low, high)
    if camera != "inside the volume":
        # on a vertex, edge or face of the box; and behind a silhouette edge that is on the volume's side
        on_side = rng.random(3) < 0.7
        in_box = np.where(on_side, np.where(rng.random(3) < 0.5, low, high), in_box)
    matrix = instance.matrix()
    point = matrix[:, :3] @ in_box + matrix[:, 3]
    away = -np.array(light.direction) if isinstance(light, DirectionalLight) else point - np.array(light.position)
    return point + (0.0 if camera == "on the box" else rng.uniform(0.0, 2.0)) * away


def _random_views(camera, kind, count, seed):
    """Worlds with one caster over a ground that casts nothing, and what a camera sees of them."""
    rng = np.random.default_rng(seed)
    while count:
        mesh, light = _random_mesh(rng), _random_light(kind, rng)
        instance = Instance(
            1,
            tuple(rng.uniform((-1.0, -0.5, -1.0), (1.0, 2.5, 1.0))),
            tuple(rng.uniform(0.3, 2.0, 3) * rng.choice((-1.0, 1.0), 3)),
            Rotation(tuple(rng.normal(size=3)), rng.uniform(0.0, 360.0)),
        )
        eye = _random_eye(camera, mesh, instance, light, rng)
        # at the middle of the scene, or down where shadows fall
        target = rng.uniform(-1.0, 1.0, 3) if rng.random() < 0.5 else eye * (1.0, 0.0, 1.0) + rng.uniform(-1.0, 0.0, 3)
        looking = Camera(tuple(eye), tuple(target), tuple(rng.normal(size=3)), rng.uniform(20.0, 100.0))
        meshes = Mesh("ground", *square(4.0)), mesh
        world = place(Scene(meshes, (Instance(0, casts=False), instance), {"light": light}, {"camera": looking}))
        try:
            samples = int(rng.choice((1, 3)))
            receivers = render(world, world.cameras["camera"], 64, 48, Context(), samples=samples)
        except SceneError:  # it looks at nothing
            continue
        count -= 1
        yield world, receivers


def _shadowed(world, receivers):
    truth = hard_reference(world, receivers, world.lights["light"], Context())
    return receivers.valid & truth.in_field & ~truth.turned_away & (truth.visibility == 0.0)


@pytest.mark.parametrize("camera", CAMERAS)
@pytest.mark.parametrize("kind", ["sun", "spot", "lamp"])
def test_every_receiver_that_the_caster_shadows_is_a_candidate_whichever_test_comes_first(kind, camera):
    shadowed_count = candidate_count = receiver_count = 0
    for world, receivers in _random_views(camera, kind, VIEW_COUNT, seed=CAMERAS.index(camera)):
        shadowed = _shadowed(world, receivers)
        results = {}
        for first in ("z-pass", "z-fail"):
            method = made(candidates=first, rotation="exact", resolution=32)
            built(method, world, receivers, "light")
            results[first] = shaded(method, receivers)
            assert results[first][1].masks["candidates"][shadowed].all()
        (visibility, trace), (other_visibility, other_trace) = results.values()
        np.testing.assert_array_equal(visibility, other_visibility)
        np.testing.assert_array_equal(trace.masks["candidates"], other_trace.masks["candidates"])
        assert (visibility[~trace.masks["candidates"]] == 1.0).all()
        shadowed_count += shadowed.sum()
        receiver_count += receivers.count
        candidate_count += trace.masks["candidates"].sum()
    assert shadowed_count > 500
    assert candidate_count < 0.9 * receiver_count


@pytest.mark.parametrize("first", ["z-pass", "z-fail"])
@pytest.mark.parametrize("kind", ["sun", "lamp"])
def test_skipping_the_other_test_asks_more_and_changes_only_what_maps_say_outside_of_volumes(kind, first):
    skipped_count = 0
    for world, receivers in _random_views("anywhere", kind, VIEW_COUNT, seed=20):
        results = []
        for skips in (False, True):
            method = made(candidates=first, skip_other_test=skips, rotation="exact", resolution=32)
            built(method, world, receivers, "light")
            results.append(shaded(method, receivers))
        (visibility, trace), (skipping, skipping_trace) = results
        np.testing.assert_array_equal(trace.masks["candidates"], skipping_trace.masks["candidates"])
        assert trace.counters["candidates"] == skipping_trace.counters["candidates"] == trace.counters["look-ups"]
        assert trace.counters["fill"] == skipping_trace.counters["fill"] >= skipping_trace.counters["look-ups"]
        assert skipping_trace.counters["look-ups"] >= trace.counters["look-ups"]
        inside = trace.masks["candidates"]
        np.testing.assert_array_equal(visibility[inside], skipping[inside])
        skipped_count += skipping_trace.counters["look-ups"] - trace.counters["look-ups"]
    assert skipped_count > 1000


def test_counters_are_sums_and_the_largest_of_what_is_seen_by_receiver():
    rng = np.random.default_rng(3)
    ground, on_ground = square(4.0)
    vertices, triangles = soup(40, rng)
    instances = [Instance(1, tuple(rng.uniform(-2.0, 2.0, 3))) for _ in range(12)]
    world = place(
        Scene(
            (Mesh("ground", ground, on_ground), Mesh("soup", vertices, triangles)),
            (Instance(0, receives=False), *instances),
            {"light": DirectionalLight((0.4, 1.0, 0.3))},
            {"camera": Camera((1.5, 4.0, 7.0), (0.0, 0.4, 0.0))},
        )
    )
    receivers = render(world, world.cameras["camera"], 100, 75, Context())
    method = made()
    built(method, world, receivers, "light")
    _, trace = shaded(method, receivers)
    fill, overdraw = trace.heats["fill"], trace.heats["overdraw"]
    assert trace.counters["fill"] == fill.sum()
    assert trace.counters["look-ups"] == trace.counters["candidates"] == overdraw.sum()
    assert trace.counters["largest overdraw"] == overdraw.max() > 3
    assert (overdraw <= fill).all()
    assert not overdraw[~receivers.valid].any()
    np.testing.assert_array_equal(trace.masks["candidates"], overdraw > 0)
