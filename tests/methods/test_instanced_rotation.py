"""Rotated instances: which maps stand for an angle, and what their interpolation gives."""

from __future__ import annotations

import math

import numpy as np
import pytest
from builders import box
from hypothesis import given, settings
from hypothesis import strategies as st
from instancing import copse, result, seen, turned, world_of_instances

from shadowbench.device.launch import Context
from shadowbench.errors import ParameterError
from shadowbench.light_space import axes_of, bounds_along, orthographic_frame
from shadowbench.methods.instanced import Instanced
from shadowbench.methods.instanced.angles import exact, interpolated, nearest
from shadowbench.parameters import parse_parameters
from shadowbench.reference import hard_reference
from shadowbench.scene import Instance, Rotation

UP = (0.0, 1.0, 0.0)
POST = box((-0.3, 0.0, -0.2), (0.3, 1.4, 0.25))
MODES = ("exact", "nearest", "interpolated-depth", "interpolated-result")


# --- which maps


@pytest.mark.parametrize(
    ("angle", "expected"),
    [
        (0.0, [(0.0, 1.0)]),
        (30.0, [(30.0, 1.0)]),
        (37.5, [(30.0, 0.75), (60.0, 0.25)]),
        (52.5, [(60.0, 0.75), (30.0, 0.25)]),
        (45.0, [(30.0, 0.5), (60.0, 0.5)]),
        (352.5, [(0.0, 0.75), (330.0, 0.25)]),
        (-7.5, [(0.0, 0.75), (330.0, 0.25)]),
        (390.0, [(30.0, 1.0)]),
        (-330.0, [(30.0, 1.0)]),
        (60.00009, [(60.0, 1.0)]),
        (59.99991, [(60.0, 1.0)]),
        (359.99995, [(0.0, 1.0)]),
        (-1e-20, [(0.0, 1.0)]),
    ],
)
def test_an_angle_is_shared_by_its_neighbours_the_nearer_first(angle, expected):
    found = interpolated(Rotation(UP, angle), 12)
    assert [(rotation.angle, share) for rotation, share in found] == [(a, pytest.approx(s)) for a, s in expected]
    assert nearest(Rotation(UP, angle), 12) == ((found[0][0], 1.0),)


def test_an_angle_a_little_off_a_step_is_not_the_step():
    assert len(interpolated(Rotation(UP, 60.0002), 12)) == 2
    assert len(interpolated(Rotation(UP, 59.9998), 12)) == 2


@settings(max_examples=200, deadline=None)
@given(angle=st.floats(-1e4, 1e4), steps=st.integers(1, 90))
def test_shares_add_up_to_one_exactly_and_their_angles_to_the_angle(angle, steps):
    found = interpolated(Rotation(UP, angle), steps)
    shares = [share for _, share in found]
    assert sum(shares) == 1.0
    assert 1.0 - shares[0] - (shares[1] if len(shares) > 1 else 0.0) == 0.0
    assert shares == sorted(shares, reverse=True)
    turns = [math.remainder(rotation.angle - angle, 360.0) for rotation, _ in found]
    assert all(abs(turn) <= 360.0 / steps + 1e-6 for turn in turns)
    mean = sum(share * turn for share, turn in zip(shares, turns, strict=True))
    assert abs(mean) < 2e-4 or steps == 1  # one map stands for the whole circle


def test_axes_of_any_length_and_sense_are_one_axis():
    assert interpolated(Rotation((0.0, -2.0, 0.0), -37.5), 12) == interpolated(Rotation(UP, 37.5), 12)
    assert exact(Rotation((0.0, -3.0, 4.0), 20.0)) == exact(Rotation((0.0, 0.3, -0.4), -20.0))
    assert exact(Rotation((1.0, 0.0, 0.0), 0.0)) == exact(Rotation(UP, 360.0))


def test_steps_divide_the_circle_or_are_refused():
    for step in (30.0, 15, 7.2, 360):
        parse_parameters(Instanced.Parameters, {"step": step}, owner="method 'instanced'")
    with pytest.raises(ParameterError, match=r"360 / 50 is no whole number"):
        parse_parameters(Instanced.Parameters, {"step": "50"}, owner="method 'instanced'")
    with pytest.raises(ParameterError, match="greater than 0"):
        parse_parameters(Instanced.Parameters, {"step": -30}, owner="method 'instanced'")


# --- what they give


@pytest.mark.parametrize("axis", [UP, (0.3, 1.0, -0.2)])
@pytest.mark.parametrize("step", [30.0, 45.0])
def test_at_multiples_of_the_step_every_mode_is_the_direct_map_bit_for_bit(step, axis):
    rng = np.random.default_rng(1)
    instances = [
        Instance(1, (x, 0.0, z), (size,) * 3, Rotation(axis, step * (k - 3)))
        for k, (x, z, size) in enumerate(rng.uniform((-2.0, -2.0, 0.5), (2.0, 2.0, 1.0), (8, 3)).tolist())
    ]
    world = world_of_instances(POST, instances)
    receivers = seen(world)
    direct, trace = result(world, receivers, rotation="exact", resolution=128)
    assert trace.counters["maps built"] == 8
    assert (direct == 0.0).sum() > 100
    for mode in MODES[1:]:
        stepped, other = result(world, receivers, rotation=mode, step=step, resolution=128)
        np.testing.assert_array_equal(stepped, direct)
        np.testing.assert_array_equal(other.kept["shadow maps"].numpy(), trace.kept["shadow maps"].numpy())
        assert other.counters == trace.counters


def _depth_behind(world, receivers, depth, angle, bias):
    """How far receivers are behind one angle's map, as lengths along the light, in NumPy; NaN where it is empty."""
    (instance,) = world.casters.instances
    vertices = world.meshes[1].vertices
    sun = np.array(world.lights["sun"].direction, dtype=np.float64)
    sun /= np.linalg.norm(sun)
    c, s = math.cos(math.radians(angle)), math.sin(math.radians(angle))
    mesh_from_world = np.array([(c, 0.0, -s), (0.0, 1.0, 0.0), (s, 0.0, c)])
    low, high = vertices.min(axis=0).astype(np.float64), vertices.max(axis=0).astype(np.float64)
    corners = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * (high - low) / 2.0
    axes = axes_of(-mesh_from_world @ sun)
    frame = orthographic_frame(axes[2], *bounds_along(axes, corners), axes)
    in_mesh = (receivers.position.astype(np.float64) - instance.translation) @ mesh_from_world.T / instance.scale[0]
    u, v, d, _ = frame.project(in_mesh - (low + high) / 2.0).T
    size = len(depth)
    column, row = np.floor(u * size).astype(int), np.floor(v * size).astype(int)
    is_in = (column >= 0) & (column < size) & (row >= 0) & (row < size)
    z = depth[np.clip(row, 0, size - 1), np.clip(column, 0, size - 1)] * 1024.0  # the far plane is at 1/1024
    behind = np.where(is_in & (z < 1024.0), d - bias - z, np.nan)
    return behind * frame.depth_range * instance.scale[0]


@pytest.mark.parametrize(("angle", "share_above"), [(40.0, 1.0 / 3.0), (52.5, 0.75), (45.0, 0.5)])
def test_depths_or_results_are_interpolated_between_the_two_maps(angle, share_above):
    tree = copse(instances=1, triangles=400).meshes[1]
    world = world_of_instances(tree, [turned(angle, x=0.4, z=-0.3, size=0.8)])
    receivers = seen(world, 240, 180)
    values = {"resolution": 96, "bias": 1e-2, "slope_bias": 0.0}
    by_depth, trace = result(world, receivers, rotation="interpolated-depth", **values)
    by_result, _ = result(world, receivers, rotation="interpolated-result", **values)
    of_nearest, nearest_trace = result(world, receivers, rotation="nearest", **values)
    maps = trace.kept["shadow maps"].numpy().reshape(2, 96, 96)
    # the nearer angle's map comes first; of two equally near, the lower's
    order = (0, 1) if share_above <= 0.5 else (1, 0)
    below, above = (_depth_behind(world, receivers, maps[order[k]], a, 1e-2) for k, a in enumerate((30.0, 60.0)))
    first = (below, above)[order[0]]
    inside = trace.masks["candidates"]

    both = ~np.isnan(below) & ~np.isnan(above)
    blended = (1.0 - share_above) * below + share_above * above
    expected = np.where(both, blended, first) > 0.0
    assert ((by_depth == 0.0) != (expected & inside)).sum() <= 2  # within rounding of a texel's border
    lit = 1.0 - (1.0 - share_above) * (below > 0.0) - share_above * (above > 0.0)
    assert (np.abs(by_result - np.where(inside, lit, 1.0)) > 1e-5).sum() <= 4
    assert ((of_nearest == 0.0) != ((first > 0.0) & inside)).sum() <= 2
    np.testing.assert_array_equal(nearest_trace.kept["shadow maps"].numpy(), maps[0].ravel())
    # there is something to tell apart
    assert (by_depth != of_nearest).sum() > 20
    assert (np.isnan(below) != np.isnan(above))[inside].sum() > 20
    assert len(np.unique(by_result)) >= 3


def _disc_stack():
    """A solid of revolution about the vertical: a cone on a cylinder, of 360 sides."""
    turn = np.arange(360) * (2.0 * np.pi / 360.0)
    rings = [(0.15, 0.0), (0.15, 0.5), (0.6, 0.5), (0.01, 1.6)]
    vertices = np.concatenate(
        [np.stack([r * np.cos(turn), np.full(360, y), r * np.sin(turn)], axis=1) for r, y in rings]
    )
    k = np.arange(360)
    triangles = []
    for ring in range(3):
        a, b = 360 * ring + k, 360 * ring + (k + 1) % 360
        triangles += [np.stack([a, a + 360, b], axis=1), np.stack([b, a + 360, b + 360], axis=1)]
    return vertices.astype(np.float32), np.concatenate(triangles).astype(np.int32)


def test_interpolated_depth_is_right_for_what_is_round_about_the_axis():
    world = world_of_instances(_disc_stack(), [turned(15.0, x=-1.2), turned(160.5, x=1.0), turned(271.0, z=1.2)])
    receivers = seen(world, 320, 240)
    visibility, _ = result(world, receivers, rotation="interpolated-depth", resolution=512)
    truth = hard_reference(world, receivers, world.lights["sun"], Context())
    scored = ~truth.turned_away
    assert ((visibility != truth.visibility) & scored).sum() < 0.005 * scored.sum()


def test_smaller_steps_fail_less_on_what_is_not_round():
    world = copse(model="bench", instances=9, triangles=100)
    receivers = seen(world, 320, 240)
    truth = hard_reference(world, receivers, world.lights["sun"], Context())
    scored = receivers.valid & ~truth.turned_away
    for mode in MODES[1:]:
        failures = []
        for step in (60.0, 30.0, 7.5):
            visibility, _ = result(world, receivers, rotation=mode, step=step, resolution=256)
            failures.append((((visibility >= 0.5) != (truth.visibility == 1.0)) & scored).mean())
        assert failures[0] > 1.3 * failures[1] > 1.3**2 * failures[2] > 0.0


def test_hard_shadows_come_of_interpolated_depths_and_soft_ones_of_interpolated_results():
    world = copse(instances=4, triangles=400)
    receivers = seen(world)
    hard, _ = result(world, receivers, rotation="interpolated-depth", resolution=128)
    soft, _ = result(world, receivers, rotation="interpolated-result", resolution=128)
    assert set(np.unique(hard)) == {0.0, 1.0}
    assert len(np.unique(soft)) > 4


@pytest.mark.parametrize("light", ["spot", "lamp"])
def test_under_a_light_from_a_place_every_mode_is_exact(light):
    world = world_of_instances(POST, [turned(40.0, x=-1.0), turned(125.0, x=1.0)])
    receivers = seen(world)
    direct, trace = result(world, receivers, light, rotation="exact", resolution=64)
    for mode in MODES[1:]:
        visibility, other = result(world, receivers, light, rotation=mode, resolution=64)
        np.testing.assert_array_equal(visibility, direct)
        assert other.counters == trace.counters
