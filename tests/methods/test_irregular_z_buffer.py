"""The irregular z-buffer: the ground truth on every receiver, whatever the layout, light and number of threads."""

import numpy as np
import pytest
from irregular import LIGHTS, WORLDS, differing, scaled, soup_of
from surfaces import scattered_receivers, soup, world_of
from tracing import shaded

from shadowbench.device.launch import Context
from shadowbench.method import Trace
from shadowbench.methods.irregular_z_buffer import IrregularZBuffer
from shadowbench.scene import RectangularLight


def method(threads=1, **parameters):
    return IrregularZBuffer(IrregularZBuffer.Parameters(**parameters), Context(threads=threads))


@pytest.mark.parametrize("light", LIGHTS)
@pytest.mark.parametrize("world", WORLDS)
def test_every_receiver_is_what_the_ground_truth_says(world, light):
    placed, receivers = WORLDS[world]()
    assert differing(method(), placed, receivers, light)[0] == 0


@pytest.mark.parametrize("power", [-48, -30, 30, 48])
def test_the_unit_of_length_changes_no_shadow(power):
    world, receivers = soup_of(500)
    moved, moved_receivers = scaled(world, receivers, 2.0**power)
    for light in ("directional", "spot with a near plane", "point inside"):
        truth, _ = shaded(method(), world, world.lights[light], receivers)
        assert differing(method(), moved, moved_receivers, light)[0] == 0
        found, _ = shaded(method(), moved, moved.lights[light], moved_receivers)
        np.testing.assert_array_equal(found, truth)


@pytest.mark.parametrize("resolution", [1, 7, 512])
def test_the_uniform_layout_gives_the_same_shadows_at_any_resolution(resolution):
    world, receivers = soup_of(500)
    for light in ("directional", "point inside"):
        assert differing(method(layout="uniform", resolution=resolution), world, receivers, light)[0] == 0


@pytest.mark.parametrize("layout", ["adaptive", "uniform"])
def test_bits_and_counters_do_not_depend_on_the_number_of_threads(layout):
    world, receivers = soup_of(5000)
    for light in ("directional", "point inside"):
        one, counted_by_one = shaded(method(1, layout=layout), world, world.lights[light], receivers)
        three, counted_by_three = shaded(method(3, layout=layout), world, world.lights[light], receivers)
        np.testing.assert_array_equal(one, three)
        assert counted_by_one.counters == counted_by_three.counters


def test_receivers_crowded_into_one_place_are_sorted_too():
    rng = np.random.default_rng(3)
    world = world_of(soup(200, rng), lights=LIGHTS)
    receivers = scattered_receivers(world, 3000, rng)
    receivers.position[:2900] = receivers.position[0]
    receivers.normal[:2900] = receivers.normal[0]
    receivers.triangle[:2900] = receivers.triangle[0]
    assert differing(method(), world, receivers, "directional")[0] == 0


def test_one_object_shades_frames_of_different_sizes():
    world = world_of(soup(300, np.random.default_rng(4)), lights=LIGHTS)
    shader = method()
    for count in (4000, 10, 1, 5000):
        receivers = scattered_receivers(world, count, np.random.default_rng(count))
        for light in ("directional", "point inside"):
            assert differing(shader, world, receivers, light)[0] == 0


@pytest.mark.parametrize("parameters", [{}, {"layout": "uniform"}, {"layout": "uniform", "resolution": 7}])
@pytest.mark.parametrize("light", ["directional", "spot", "point inside"])
@pytest.mark.parametrize("count", [3, 3000])
def test_it_shows_the_cells_of_strips_that_hold_samples_and_no_others(parameters, light, count):
    world = world_of(soup(200, np.random.default_rng(6)), lights=LIGHTS)
    receivers = scattered_receivers(world, count, np.random.default_rng(7))
    shader = method(**parameters)
    shaded(shader, world, world.lights[light], receivers)
    cells = shader._rasterizer.cells()
    assert len(cells) > 0
    assert np.isfinite(cells).all()
    assert (cells[:, :2] <= cells[:, 2:]).all()
    trace = Trace(Context())
    shader.explain(receivers, trace)
    assert {"samples in light space", "cells over the samples"} <= trace.pictures.keys()


def test_what_is_not_asked_for_stays_dark_and_unsampled():
    world, receivers = soup_of(60)
    receivers.valid[::2] = False
    visibility, _ = shaded(method(), world, world.lights["directional"], receivers)
    assert not visibility[::2].any()
    assert visibility[1::2].any()


def test_it_says_what_it_cannot_do():
    world, _ = soup_of(60)
    assert "area light" in method().supports(world, RectangularLight((0, 2, 0), (1, 0, 0), (0, 0, 1)))


def test_what_stays_alive_is_reported_and_grows_with_the_receivers():
    world = world_of(soup(300, np.random.default_rng(4)), lights=LIGHTS)
    kept = []
    for count in (1000, 8000):
        receivers = scattered_receivers(world, count, np.random.default_rng(count))
        _, trace = shaded(method(), world, world.lights["directional"], receivers)
        kept.append(trace.bytes_by_name())
    assert all(after >= before > 0 for before, after in zip(kept[0].values(), kept[1].values(), strict=True))
    assert kept[1]["windows of the receivers"] == 8000
