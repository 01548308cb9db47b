"""Views of worlds that tests build, as commands open them from a scene."""

from __future__ import annotations

from shadowbench.camera_pass import render
from shadowbench.device.launch import Context
from shadowbench.inspection.opening import OpenView
from shadowbench.reference import hard_reference
from shadowbench.runner.cases import View
from shadowbench.world import World


def opened(world: World, light: str = "sun", *, width: int = 48, height: int = 36, pixel_samples: int = 1) -> OpenView:
    """Open a world's first camera."""
    name, camera = next(iter(world.cameras.items()))
    context = Context()
    receivers = render(world, camera, width, height, context, samples=pixel_samples)
    reference = hard_reference(world, receivers, world.lights[light], context)
    view = View("built", {}, "key", "content", world.triangle_count, light, name, width, height, pixel_samples)
    return OpenView(view, world, world.lights[light], camera, receivers, reference)
