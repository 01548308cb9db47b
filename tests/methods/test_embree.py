"""The peer: the same rays as the ray tracer's offset rule, and an independent verdict on them."""

import os
from dataclasses import replace
from importlib.metadata import PackageNotFoundError

import numpy as np
import pytest
from builders import box, square
from oracles import is_behind_box, plane_hits
from surfaces import corners_of, homogeneous, receivers_at, scattered_receivers, soup, world_of
from tracing import contexts, shaded

from shadowbench.camera_pass import render
from shadowbench.device.launch import Context
from shadowbench.device.rays import OffsetRays
from shadowbench.methods import embree as module
from shadowbench.methods.embree import Embree, EmbreeParameters
from shadowbench.methods.ray_traced import RayTraced, RayTracedParameters
from shadowbench.plugins import Registry
from shadowbench.scene import DirectionalLight, PointLight, RectangularLight, SpotLight
from shadowbench.world import place

pytest.importorskip("embreex", reason="the extra 'peers' is not installed")

CONTEXT = Context()

LIGHTS = {
    "directional": DirectionalLight((0.4, 1.0, 0.3)),
    "spot": SpotLight((1.5, 4.0, 1.0), (-1.5, -4.0, -1.0), 30.0),
    "point within": PointLight((0.2, 0.6, 0.1)),
    "near plane": PointLight((0.2, 0.9, 0.1), near=0.3),
}


def peer(context=CONTEXT, offset=1e-5):
    return Embree(EmbreeParameters(offset=offset), context)


def ordinary(context=CONTEXT):
    return RayTraced(RayTracedParameters(self_hit="offset"), context)


def unexplained(world, light, receivers, differing):
    """Of receivers on which tracers differ, those whose ray does not pass within 1e-4 of a triangle's edge."""
    rays = OffsetRays(receivers, light, 1e-5 * world.diagonal(), CONTEXT)
    origin, towards, reach = (a.numpy() for a in (rays.origin, rays.towards, rays.reach))
    corners = corners_of(world)
    left = []
    for i in differing:
        t, inside = plane_hits(origin[i], towards[i], corners)
        on_ray = (t > 0.0) & (t < reach[i])
        near_edge = (on_ray & (np.abs(inside) < 1e-4)).any()
        certainly_blocked = (on_ray & (inside >= 1e-4)).any()
        if certainly_blocked or not near_edge:
            left.append(int(i))
    return left


@pytest.mark.parametrize("light", LIGHTS)
def test_on_the_same_rays_it_agrees_with_the_ray_tracer_but_for_rays_along_edges(light):
    rng = np.random.default_rng(1)
    world = world_of(soup(1500, rng), lights=LIGHTS)
    receivers = scattered_receivers(world, 20_000, rng)
    placed = world.lights[light]
    found, _ = shaded(peer(), world, placed, receivers)
    expected, _ = shaded(ordinary(), world, placed, receivers)
    differing = np.flatnonzero(found != expected)
    assert len(differing) <= 2
    assert unexplained(world, placed, receivers, differing) == []
    assert 0.1 < found.mean() < 0.9


@pytest.mark.slow
@pytest.mark.parametrize("count", [1_000, 100_000])
@pytest.mark.parametrize("light", ["directional", "point within"])
def test_on_a_whole_picture_they_differ_on_ten_receivers_at_most(count, light):
    rng = np.random.default_rng(2)
    world = world_of(soup(count, rng), lights=LIGHTS)
    receivers = scattered_receivers(world, 1024 * 768, rng)
    placed, context = world.lights[light], Context(threads=2)
    found, _ = shaded(peer(context), world, placed, receivers)
    expected, _ = shaded(ordinary(context), world, placed, receivers)
    differing = np.flatnonzero(found != expected)
    assert len(differing) <= 10
    assert unexplained(world, placed, receivers, differing) == []


@pytest.mark.parametrize("light", LIGHTS)
def test_the_same_bits_come_out_for_one_and_two_threads(light):
    rng = np.random.default_rng(3)
    world = world_of(soup(1500, rng), lights=LIGHTS)
    receivers = scattered_receivers(world, 20_000, rng)
    one, two = (shaded(peer(c), world, world.lights[light], receivers)[0] for c in contexts())
    np.testing.assert_array_equal(one, two)


@pytest.mark.parametrize("light", [LIGHTS["directional"], PointLight((0.9, 1.4, 0.7))], ids=["directional", "point"])
def test_the_shadow_of_a_box_on_a_plane_is_its_closed_form(light):
    rng = np.random.default_rng(4)
    low, high = np.array((-0.5, 0.0, -0.5)), np.array((0.5, 1.0, 0.5))
    world = world_of(square(3.0), box(tuple(low), tuple(high)), lights={"light": light})
    receivers = receivers_at(world, rng.integers(0, 2, 20_000), rng.dirichlet((1.0, 1.0, 1.0), 20_000))
    placed = world.lights["light"]
    found, _ = shaded(peer(), world, placed, receivers)
    band = 4e-4  # the offset moves the shadow's outline
    inner, outer = (is_behind_box(receivers.position, low + e, high - e, homogeneous(placed)) for e in (band, -band))
    assert (found[inner] == 0.0).all()
    assert (found[~outer] == 1.0).all()
    assert inner.sum() > 500


def test_receivers_that_ask_for_nothing_get_no_ray():
    rng = np.random.default_rng(5)
    world = world_of(soup(300, rng), lights=LIGHTS)
    everything = scattered_receivers(world, 4000, rng)
    some = replace(everything, valid=rng.random(4000) < 0.5)
    for light in ("directional", "spot"):
        found, trace = shaded(peer(), world, world.lights[light], some)
        full, _ = shaded(peer(), world, world.lights[light], everything)
        np.testing.assert_array_equal(found[some.valid], full[some.valid])
        expected, reported = shaded(ordinary(), world, world.lights[light], some)
        assert trace.counters == reported.counters
        assert (found[expected == 0.0] == 0.0).all()


def test_stages_tell_the_bindings_copy_from_the_tree():
    rng = np.random.default_rng(6)
    world = world_of(soup(300, rng), lights=LIGHTS)
    receivers = scattered_receivers(world, 100, rng)
    method = peer()
    _, trace = shaded(method, world, world.lights["directional"], receivers)
    assert list(trace.stages) == ["buffer copy", "BVH construction", "field of view", "ray generation", "shadow rays"]
    assert trace.bytes_by_name() == {"triangle buffers": 16 * len(world.vertices) + 12 * len(world.triangles)}
    _, trace = shaded(method, world, world.lights["point within"], receivers, instances=frozenset())
    assert list(trace.stages) == ["field of view", "ray generation", "shadow rays"]
    method.close()


def test_building_leaves_the_processors_of_the_process_alone():
    rng = np.random.default_rng(7)
    world = world_of(soup(50, rng), lights=LIGHTS)
    before = os.sched_getaffinity(0) if hasattr(os, "sched_getaffinity") else None
    shaded(peer(), world, world.lights["directional"], scattered_receivers(world, 10, rng))
    assert before is None or os.sched_getaffinity(0) == before


def test_where_nothing_casts_everything_is_lit():
    world = world_of(square(1.0), lights=LIGHTS, casts=(False,))
    receivers = receivers_at(world, np.array([0, 1]), np.array([[0.5, 0.0, 0.5], [0.3, 0.3, 0.4]]))
    assert (shaded(peer(), world, world.lights["directional"], receivers)[0] == 1.0).all()
    method = peer()  # also after casters were there
    roofed = world_of(square(1.0), square(1.0, 0.5), lights=LIGHTS)
    assert (shaded(method, roofed, roofed.lights["directional"], receivers)[0] == 0.0).any()
    assert (shaded(method, world, world.lights["directional"], receivers)[0] == 1.0).all()


@pytest.mark.parametrize(
    ("installed", "reason"),
    [
        ("4.4.0.post1", None),
        ("5.0", None),
        ("2.17.7.post7", "too old"),
        (PackageNotFoundError("embreex"), "shadowbench\\[peers\\]"),
    ],
    ids=["tested", "newer", "older", "missing"],
)
def test_it_says_why_it_cannot_run_here(monkeypatch, installed, reason):
    def version(package):
        assert package == "embreex"
        if isinstance(installed, Exception):
            raise installed
        return installed

    monkeypatch.setattr(module, "version", version)
    found = Embree.available()
    if reason is None:
        assert found is None
    else:
        assert reason.replace("\\", "") in (found or "")


def test_it_says_what_it_cannot_do_and_names_its_rule():
    panel = RectangularLight((0.0, 2.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0))
    assert "area light" in (peer().supports(world_of(square(1.0), lights={"panel": panel}), panel) or "")
    glass = world_of(square(1.0), lights=LIGHTS, transmittance=(0.5, 0.5, 0.5))
    assert "opaque" in (peer().supports(glass, glass.lights["spot"]) or "")
    assert peer(offset=1e-4).self_hit_rule() == "offset:0.0001"


@pytest.mark.slow
@pytest.mark.parametrize("name", ["box-on-plane", "sphere-on-plane", "bunny", "random-triangles"])
def test_on_every_shipped_scene_they_differ_on_ten_receivers_at_most(name):
    plugin = Registry().scene(name)
    world = place(plugin().make(plugin.Parameters()))
    camera, context = next(iter(world.cameras.values())), Context(threads=2)
    receivers = render(world, camera, 1024, 768, context)
    for light in world.lights.values():
        found, _ = shaded(peer(context), world, light, receivers)
        expected, _ = shaded(ordinary(context), world, light, receivers)
        differing = np.flatnonzero((found != expected) & receivers.valid)
        assert len(differing) <= 10
        assert unexplained(world, light, receivers, differing) == []
