"""Every technique's account on every light of a scene, beside what shade() wrote."""

from __future__ import annotations

from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from shadowbench.account import Account
from shadowbench.light_space import camera_frame
from shadowbench.method import Changes, Context, Method, Trace, View
from shadowbench.plugins import Registry
from shadowbench.receivers import Receivers
from shadowbench.world import World

REGISTRY = Registry()

CONFIGURATIONS: tuple[tuple[str, dict[str, Any]], ...] = (
    ("shadow-map", {"resolution": 64}),
    ("shadow-map", {"resolution": 37, "receiver_plane": True, "slope_bias": 0.0}),
    ("shadow-map", {"resolution": 64, "normal_offset": 2.0}),
    ("pcf", {"resolution": 64, "filter": "bilinear"}),
    ("pcf", {"resolution": 64, "filter": "gauss", "kernel": 7}),
    ("pcf", {"resolution": 64, "filter": "box", "kernel": 4, "receiver_plane": True}),
    ("pcf", {"resolution": 64, "footprint": "pixel", "kernel": 6, "normal_offset": 1.0}),
    ("esm", {"resolution": 64}),
    ("esm", {"resolution": 64, "classification": "z-max", "filtering": "anisotropic", "fallback_source": "unblurred"}),
    ("esm", {"resolution": 64, "log_space": True, "c": 500.0, "kernel": 3}),
    ("esm", {"resolution": 64, "classification": "none", "filtering": "nearest", "kernel": 0}),
    ("vsm", {"resolution": 64}),
    ("vsm", {"resolution": 33, "slope_term": True, "bleeding_reduction": 0.2, "filtering": "bilinear"}),
    ("csm", {"resolution": 64}),
    ("csm", {"resolution": 64, "basis": "float", "terms": 7, "attenuation": 1.0, "kernel": 0}),
    ("instanced", {"resolution": 64}),
    ("instanced", {"resolution": 64, "rotation": "interpolated-result", "candidates": "z-fail"}),
    ("instanced", {"resolution": 64, "application": "all-maps", "rotation": "exact"}),
    ("instanced", {"resolution": 64, "skip_other_test": True, "sizing": "importance"}),
    ("afsm", {}),
    ("irregular-z-buffer", {}),
    ("ray-traced", {}),
    ("ray-traced", {"self_hit": "offset", "offset": 1.0e-3}),
    ("embree", {}),
    ("no-shadows", {}),
)


def shaded(
    name: str, values: dict[str, Any], world: World, receivers: Receivers, light: str
) -> tuple[Method, NDArray[np.float32]] | str:
    """Return a method after build() and shade(), and what it wrote; or why it does not apply."""
    cls: type[Method] = REGISTRY.method(name)
    reason = cls.available()
    if reason is not None:
        return reason
    context = Context()
    method = cls(cls.Parameters(**values), context)
    reason = method.supports(world, world.lights[light])
    if reason is not None:
        return reason
    camera = next(iter(world.cameras.values()))
    size = receivers.width, receivers.height
    view = View(camera, *size, camera_frame(camera, *size, world))
    shape = (receivers.count,) if world.casters.is_opaque else (receivers.count, 3)
    visibility = wp.array(np.full(shape, np.nan, np.float32), dtype=wp.float32, device="cpu")
    every = frozenset(range(len(world.casters.instances)))
    trace = Trace(context)
    method.build(world.casters, world.lights[light], view, Changes(light=True, instances=every, view=True), trace)
    method.shade(receivers, visibility, trace)
    return method, visibility.numpy().copy()


def spread(visibility: NDArray[np.float32], receivers: Receivers, count: int) -> list[int]:
    """Return receivers of all kinds: the darkest, the most lit, and between."""
    first = visibility.reshape(len(visibility), -1)[:, 0]
    order = np.flatnonzero(receivers.valid)[np.argsort(first[receivers.valid], kind="stable")]
    edges = np.flatnonzero((first > 0.0) & (first < 1.0))
    chosen = [order[np.linspace(0, len(order) - 1, count).astype(int)], edges[:: max(1, len(edges) // count)][:count]]
    return sorted(set(np.concatenate(chosen).tolist()))


def differences(account: Account, written: NDArray[np.float32]) -> float:
    """Return the largest difference between an account's visibility and what was written."""
    return float(np.abs(np.atleast_1d(account.visibility) - np.atleast_1d(written).astype(np.float64)).max())
