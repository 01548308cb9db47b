"""Many frames on two threads beside one on a single thread: blocks of work that reach into each other's memory show
only now and then, in some frames and at few receivers, and only in scenes large enough to be divided."""

from __future__ import annotations

import numpy as np
import pytest
from running import REGISTRY
from tracing import shaded

from shadowbench.camera_pass import render
from shadowbench.device.launch import Context
from shadowbench.world import place

REPEATS = 40

SMALLER_MAPS = {name: {"resolution": 512} for name in ("csm", "esm", "vsm")}
"""Cut into as many blocks as larger ones."""


@pytest.fixture(scope="module")
def view():
    scene = REGISTRY.scene("random-triangles")
    world = place(scene().make(scene.Parameters(triangles=100_000)))
    return world, render(world, world.cameras["middle"], 640, 480, Context(threads=2))


@pytest.mark.slow
@pytest.mark.parametrize("light", ["sun", "lamp"])
@pytest.mark.parametrize(
    "name", ["afsm", "csm", "esm", "instanced", "irregular-z-buffer", "pcf", "ray-traced", "shadow-map", "vsm"]
)
def test_no_bit_changes_over_many_frames_on_two_threads(view, name, light):
    world, receivers = view
    cls = REGISTRY.method(name)
    parameters = cls.Parameters(**SMALLER_MAPS.get(name, {}))

    def frame(threads):
        return shaded(cls(parameters, Context(threads=threads)), world, world.lights[light], receivers)

    visibility, traced = frame(1)
    for _ in range(REPEATS if name in ("afsm", "irregular-z-buffer") else REPEATS // 4):
        again, traced_again = frame(2)
        np.testing.assert_array_equal(again, visibility)
        assert traced_again.counters == traced.counters
