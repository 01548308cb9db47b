"""Alias-free shadow maps: the ground truth on every receiver, and the paper's counters."""

import numpy as np
import pytest
from builders import square
from irregular import LIGHTS, WORLDS, differing, scaled, soup_of
from surfaces import receivers_at, scattered_receivers, world_of
from tracing import shaded

from shadowbench.device.launch import Context
from shadowbench.methods.afsm import AliasFreeShadowMaps
from shadowbench.scene import RectangularLight


def method(threads=1, **parameters):
    return AliasFreeShadowMaps(AliasFreeShadowMaps.Parameters(**parameters), Context(threads=threads))


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


@pytest.mark.parametrize(
    "parameters",
    [{"leaf_size": 2}, {"leaf_size": 300}, {"leaf_size": 65536}, {"culling": False}, {"traversal": "brute-force"}],
)
def test_parameters_change_the_work_and_not_the_shadows(parameters):
    for world, receivers in (soup_of(500), WORLDS["solids"]()):
        for light in ("directional", "spot", "point inside"):
            assert differing(method(**parameters), world, receivers, light)[0] == 0


@pytest.mark.parametrize("parameters", [{}, {"traversal": "brute-force"}])
def test_bits_and_counters_do_not_depend_on_the_number_of_threads(parameters):
    world, receivers = soup_of(5000)
    for light in ("directional", "point inside"):
        one, counted_by_one = shaded(method(1, **parameters), world, world.lights[light], receivers)
        three, counted_by_three = shaded(method(3, **parameters), world, world.lights[light], receivers)
        np.testing.assert_array_equal(one, three)
        assert counted_by_one.counters == counted_by_three.counters


@pytest.mark.parametrize(("receiver_count", "leaves"), [(63, 1), (64, 2), (126, 2), (127, 4), (6000, 128)])
def test_nodes_are_halved_until_a_leaf_holds_fewer_than_64(receiver_count, leaves):
    world = world_of(square(1.0), lights=LIGHTS)
    receivers = scattered_receivers(world, receiver_count, np.random.default_rng(1))
    _, trace = shaded(method(), world, world.lights["directional"], receivers)
    assert trace.counters["2D BSP nodes"] == leaves


def explained(shader, world, light, receivers):
    """Shade and explain; return the visibility and what was reported."""
    visibility, trace = shaded(shader, world, world.lights[light], receivers)
    shader.explain(receivers, trace)
    return visibility, trace


def test_a_sheet_over_everything_tests_each_receiver_once_and_then_culls_whole_subtrees():
    """Sheets in file order from above: the first shadows all receivers, the others stop at the root."""
    sheets = [square(3.0, height) for height in (4.0, 3.0, 2.0)]
    world = world_of(square(1.0), *sheets, lights=LIGHTS, casts=(False, True, True, True))
    rng = np.random.default_rng(2)
    receivers = receivers_at(world, rng.integers(0, 2, 20_000), rng.dirichlet((1.0, 1.0, 1.0), 20_000))
    visibility, trace = explained(method(), world, "overhead", receivers)
    assert not visibility.any()
    for counter in ("sampling points tested", "tested after culling"):
        # a sheet's two triangles share the receivers out; those near the diagonal may be tested by both
        assert 20_000 <= trace.counters[counter] <= 20_000 + trace.counters["decided in float64"]
    without, trace_without = shaded(method(culling=False), world, world.lights["overhead"], receivers)
    assert not without.any()
    assert trace_without.counters["nodes visited"] > trace.counters["nodes visited"]
    assert trace_without.counters["nodes occlusion culled"] == 0


def test_a_receivers_own_plane_is_no_test_and_what_lies_below_is_culled_at_the_root():
    world = world_of(square(1.0), square(1.0, -1.0), lights=LIGHTS)
    receivers = scattered_receivers(world, 2000, np.random.default_rng(3))
    kept = receivers.position[:, 1] == 0.0
    receivers.valid[:] = kept
    visibility, trace = explained(method(), world, "overhead", receivers)
    np.testing.assert_array_equal(visibility, kept.astype(np.float32))
    assert trace.counters["tested after culling"] == 0
    # the square below covers every receiver, in one of its two triangles or on the diagonal in both
    assert kept.sum() <= trace.counters["sampling points tested"] <= 1.01 * kept.sum()


@pytest.mark.parametrize(
    "parameters", [{}, {"culling": False}, {"leaf_size": 5}, {"leaf_size": 1000}, {"traversal": "brute-force"}]
)
def test_the_papers_count_of_tested_points_does_not_depend_on_how_the_work_is_done(parameters):
    world, receivers = soup_of(500)
    _, trace = explained(method(**parameters), world, "directional", receivers)
    _, all_pairs = shaded(method(traversal="brute-force"), world, world.lights["directional"], receivers)
    assert trace.counters["sampling points tested"] == all_pairs.counters["tested after culling"]
    assert trace.counters["tested after culling"] <= trace.counters["sampling points tested"]
    assert all_pairs.counters["nodes visited"] == 0


@pytest.mark.parametrize(("light", "tiles"), [("directional", (1024, 1024)), ("point inside", (1024, 1536))])
def test_its_pictures_show_the_samples_and_the_tree_over_them(light, tiles):
    world, receivers = soup_of(5000)
    _, trace = explained(method(), world, light, receivers)
    assert list(trace.pictures) == ["samples in light space", "BSP over the samples"]
    samples, tree = trace.pictures.values()
    assert samples.shape == tree.shape == (*tiles, 3)
    orange, blue = ((samples == colour).all(axis=-1).sum() for colour in ((214, 137, 0), (24, 66, 130)))
    assert orange > 1000
    assert blue > 1000
    drawn_over = (samples != tree).any(axis=-1)
    assert 0.01 < drawn_over.mean() < 0.5  # boxes, and nothing but boxes


def test_it_says_what_it_cannot_do():
    world, _ = soup_of(60)
    assert "area light" in method().supports(world, RectangularLight((0, 2, 0), (1, 0, 0), (0, 0, 1)))
