"""Visibility of arbitrary points: what the ground truth says of the receivers it does not turn away."""

import numpy as np
import pytest
import warp as wp
from builders import square
from irregular import LIGHTS, WORLDS
from surfaces import world_of

from shadowbench.device.launch import Context
from shadowbench.device.point_visibility import PointVisibility
from shadowbench.reference import hard_reference


@pytest.mark.parametrize("light", LIGHTS)
def test_points_get_the_visibility_of_receivers_that_are_not_turned_away(light):
    world, receivers = WORLDS["solids"]()
    visibility = wp.empty(receivers.count, dtype=wp.float32, device="cpu")
    PointVisibility(world.casters, world.lights[light], Context(threads=2)).ask(
        receivers.on("cpu").position, visibility
    )
    truth = hard_reference(world, receivers, world.lights[light], Context())
    asked = ~truth.turned_away
    np.testing.assert_array_equal(visibility.numpy()[asked], truth.visibility[asked])


def test_a_point_in_the_lights_own_place_is_lit():
    world, _ = WORLDS["solids"]()
    lamp = world.lights["point inside"]
    position = wp.array(np.array([lamp.position, (0.0, 0.5, 0.0)], np.float32), dtype=wp.vec3, device="cpu")
    visibility = wp.empty(2, dtype=wp.float32, device="cpu")
    PointVisibility(world.casters, lamp, Context()).ask(position, visibility)
    assert visibility.numpy()[0] == 1.0


def test_translucent_casters_dim_points_by_channel():
    world = world_of(square(1.0, 1.0), square(1.0, 2.0), lights=LIGHTS, transmittance=(0.5, 0.25, 0.0))
    position = wp.array(
        np.array([(0.0, 0.0, 0.5), (0.5, 1.5, 0.0), (2.0, 0.0, 0.0)], np.float32), dtype=wp.vec3, device="cpu"
    )
    visibility = wp.empty((3, 3), dtype=wp.float32, device="cpu")
    PointVisibility(world.casters, world.lights["overhead"], Context()).ask(position, visibility)
    np.testing.assert_array_equal(visibility.numpy(), [(0.25, 0.0625, 0.0), (0.5, 0.25, 0.0), (1.0, 1.0, 1.0)])
