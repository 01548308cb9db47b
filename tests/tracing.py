"""Running one method on made-up receivers, for tests of the tracers."""

from __future__ import annotations

from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from shadowbench.device.launch import Context
from shadowbench.light_space import camera_frame
from shadowbench.method import Changes, Method, Trace, View
from shadowbench.receivers import Receivers
from shadowbench.scene import Light
from shadowbench.world import World


def shaded(
    method: Method, world: World, light: Light, receivers: Receivers, *, instances: frozenset[int] | None = None
) -> tuple[NDArray[np.float32], Trace]:
    """Build and shade once; return the visibility and what was reported. ``instances`` moved, or all of them."""
    camera = next(iter(world.cameras.values()))
    view = View(camera, 8, 8, camera_frame(camera, 8, 8, world))
    moved = frozenset(range(len(world.casters.instances))) if instances is None else instances
    trace = Trace(method.context)
    visibility: Any = wp.full(receivers.count, value=np.nan, dtype=wp.float32, device="cpu")
    method.build(world.casters, light, view, Changes(light=True, instances=moved, view=True), trace)
    method.shade(receivers, visibility, trace)
    return visibility.numpy(), trace


def contexts() -> tuple[Context, Context]:
    """One thread and two."""
    return Context(threads=1), Context(threads=2)
