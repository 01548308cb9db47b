"""Run one method on one world, as the harness does, without the harness."""

from __future__ import annotations

from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from shadowbench.light_space import camera_frame
from shadowbench.method import Changes, Context, Method, Trace, View
from shadowbench.plugins import Registry
from shadowbench.receivers import Receivers
from shadowbench.world import World

REGISTRY = Registry()


def run_method(
    name: str,
    world: World,
    receivers: Receivers,
    *,
    light: str = "sun",
    threads: int = 1,
    **values: Any,
) -> tuple[NDArray[np.float32], Trace]:
    """Return the visibility and the trace of a method with the parameters in ``values``."""
    cls: type[Method] = REGISTRY.method(name)
    context = Context(threads=threads)
    method = cls(cls.Parameters(**values), context)
    trace = Trace(context)
    camera = next(iter(world.cameras.values()))
    view = View(
        camera, receivers.width, receivers.height, camera_frame(camera, receivers.width, receivers.height, world)
    )
    visibility = wp.full(receivers.count, np.nan, dtype=wp.float32, device="cpu")
    every = frozenset(range(len(world.casters.instances)))
    method.build(world.casters, world.lights[light], view, Changes(light=True, instances=every, view=True), trace)
    method.shade(receivers, visibility, trace)
    method.explain(receivers, trace)
    return visibility.numpy().copy(), trace
