"""The leaning board: separations that grow evenly from nothing, and cameras that see them."""

from __future__ import annotations

import numpy as np
import pytest

from shadowbench.camera_pass import render
from shadowbench.device.launch import Context
from shadowbench.light_space import light_frames
from shadowbench.reference import hard_reference
from shadowbench.scene import NoParameters
from shadowbench.scenes.leaning_board import HALF_WIDTH, HEIGHT, LENGTH, LeaningBoard
from shadowbench.world import World, place


@pytest.fixture(scope="module")
def world() -> World:
    return place(LeaningBoard().make(NoParameters()))


@pytest.mark.parametrize("camera", ["under", "hinge"])
def test_the_shadow_on_the_ground_is_the_boards_and_its_separation_grows_from_the_hinge(
    world: World, camera: str
) -> None:
    receivers = render(world, world.cameras[camera], 160, 120, Context())
    truth = hard_reference(world, receivers, world.lights["sun"], Context())
    x, y, z = receivers.position.astype(np.float64).T
    on_ground = receivers.instance == 0
    inside = on_ground & (np.abs(x) < LENGTH / 2.0 - 1e-4) & (np.abs(z) < HALF_WIDTH - 1e-4) & (x > 1e-4 - LENGTH / 2.0)
    assert inside.mean() > 0.15
    assert not truth.visibility[inside].any()
    assert truth.visibility[on_ground & ((np.abs(x) > LENGTH / 2.0 + 1e-4) | (np.abs(z) > HALF_WIDTH + 1e-4))].all()
    share = (x[inside] + LENGTH / 2.0) / LENGTH
    np.testing.assert_allclose(truth.blocker_distance[inside], share * HEIGHT, atol=1e-5)
    assert y[inside].max() < 1e-6


def test_the_boards_height_is_the_suns_depth_range(world: World) -> None:
    (frame,) = light_frames(world.lights["sun"], world)
    assert frame.depth_range == pytest.approx(HEIGHT, rel=0.01)
