"""The exact methods on every scene that ships, under each of its lights: no receiver differs from the ground truth."""

from __future__ import annotations

import numpy as np
import pytest
from irregular import shaded_in_colour
from running import REGISTRY
from tracing import shaded

from shadowbench.camera_pass import render
from shadowbench.device.launch import Context
from shadowbench.reference import hard_reference
from shadowbench.scene import RectangularLight
from shadowbench.world import place

SMALLER = {"grove": {"instances": 20}, "hair-ball": {"hairs": 300}, "random-triangles": {"triangles": 20_000}}
SCENES = sorted(set(REGISTRY.names("scene")) - {"mesh-file"})


@pytest.mark.slow
@pytest.mark.parametrize("name", SCENES)
def test_no_receiver_of_a_shipped_scene_differs_from_the_ground_truth(name):
    scene = REGISTRY.scene(name)
    world = place(scene().make(scene.Parameters(**SMALLER.get(name, {}))))
    shade = shaded if world.casters.is_opaque else shaded_in_colour
    for camera in world.cameras.values():
        receivers = render(world, camera, 240, 180, Context(threads=2))
        for light in world.lights.values():
            if isinstance(light, RectangularLight):
                continue
            truth = hard_reference(world, receivers, light, Context(threads=2)).visibility
            for method in ("afsm", "irregular-z-buffer", "ray-traced"):
                cls = REGISTRY.method(method)
                visibility, _ = shade(cls(cls.Parameters(), Context(threads=2)), world, light, receivers)
                np.testing.assert_array_equal(visibility, truth)
