"""Alias-free shadow maps: the ground truth on every receiver, and the paper's counters."""

import numpy as np
import pytest
from builders import square
from irregular import LIGHTS, WORLDS, differing, soup_of
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


def test_a_sheet_over_everything_tests_each_receiver_once_and_then_culls_whole_subtrees():
    """Sheets in file order from above: the first shadows all receivers, the others stop at the root."""
    sheets = [square(3.0, height) for height in (4.0, 3.0, 2.0)]
    world = world_of(square(1.0), *sheets, lights=LIGHTS, casts=(False, True, True, True))
    rng = np.random.default_rng(2)
    receivers = receivers_at(world, rng.integers(0, 2, 20_000), rng.dirichlet((1.0, 1.0, 1.0), 20_000))
    visibility, trace = shaded(method(), world, world.lights["overhead"], receivers)
    assert not visibility.any()
    # a sheet's two triangles share the receivers out; those near the diagonal may be tested by both
    assert 20_000 <= trace.counters["sampling points tested"] <= 20_000 + trace.counters["decided in float64"]
    without, trace_without = shaded(method(culling=False), world, world.lights["overhead"], receivers)
    assert not without.any()
    assert trace_without.counters["nodes visited"] > trace.counters["nodes visited"]
    assert trace_without.counters["nodes occlusion culled"] == 0


def test_a_receivers_own_plane_is_no_test_and_what_lies_below_stops_at_the_root():
    world = world_of(square(1.0), square(1.0, -1.0), lights=LIGHTS)
    receivers = scattered_receivers(world, 2000, np.random.default_rng(3))
    kept = receivers.position[:, 1] == 0.0
    receivers.valid[:] = kept
    visibility, trace = shaded(method(), world, world.lights["overhead"], receivers)
    np.testing.assert_array_equal(visibility, kept.astype(np.float32))
    assert trace.counters["sampling points tested"] == 0


def test_brute_force_tests_what_the_tree_tests():
    world, receivers = soup_of(500)
    _, tree = shaded(method(), world, world.lights["directional"], receivers)
    _, all_pairs = shaded(method(traversal="brute-force"), world, world.lights["directional"], receivers)
    assert tree.counters["sampling points tested"] == all_pairs.counters["sampling points tested"]
    assert all_pairs.counters["nodes visited"] == 0


def test_it_says_what_it_cannot_do():
    world, _ = soup_of(60)
    assert "area light" in method().supports(world, RectangularLight((0, 2, 0), (1, 0, 0), (0, 0, 1)))
