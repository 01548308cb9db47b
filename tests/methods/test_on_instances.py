"""Every technique gives the same picture of streamed and of flat instances, bit for bit, with the same counters."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import fields, replace
from typing import Any

import numpy as np
import pytest
import warp as wp
from numpy.typing import NDArray

from shadowbench.camera_pass import render
from shadowbench.device import placed_triangles
from shadowbench.device.launch import Context
from shadowbench.light_space import camera_frame
from shadowbench.method import Changes, Trace, View
from shadowbench.plugins import Registry
from shadowbench.receivers import Receivers
from shadowbench.reference import hard_reference
from shadowbench.scene import Scene
from shadowbench.world import World, place

REGISTRY = Registry()
CASES: list[tuple[str, dict[str, Any]]] = [
    ("ray-traced", {}),
    ("ray-traced", {"self_hit": "offset"}),
    ("afsm", {}),
    ("afsm", {"traversal": "brute-force"}),
    ("irregular-z-buffer", {}),
    ("irregular-z-buffer", {"layout": "uniform", "resolution": 64}),
    ("shadow-map", {"resolution": 256}),
    ("pcf", {"resolution": 128}),
    ("esm", {"resolution": 128}),
    ("vsm", {"resolution": 128}),
    ("csm", {"resolution": 64}),
    ("instanced", {"resolution": 64}),
    ("embree", {}),
    ("opengl-shadow-map", {"resolution": 128}),
    ("opengl-esm", {"resolution": 128}),
]


def grove(*, glass: bool = False) -> Scene:
    """Five trees on a ground, a window seen through or not."""
    cls = REGISTRY.scene("grove")
    scene: Scene = cls().make(cls.Parameters(instances=5, triangles=1000))
    if glass:
        tints = [(0.5, 0.6, 0.7), (0.0, 0.0, 0.0), (0.2, 0.9, 0.4)]
        tinted = [replace(i, transmittance=tints[k % 3]) for k, i in enumerate(scene.instances[:-1])]
        scene = replace(scene, instances=(*tinted, scene.instances[-1]))
    return scene


def both(scene: Scene) -> tuple[World, World]:
    """The scene flat and streamed."""
    return place(scene, copied_triangles=10**9), place(scene, copied_triangles=0)


@pytest.fixture(autouse=True)
def _small_batches(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(placed_triangles, "BATCH_TRIANGLES", 2500)


def run(world: World, receivers: Receivers, light: str, name: str, values: dict[str, Any]) -> tuple[Any, Trace]:
    cls, context = REGISTRY.method(name), Context(threads=2)
    if (missing := cls.available()) is not None:
        pytest.skip(missing)
    method = cls(cls.Parameters(**values), context)
    if (reason := method.supports(world, world.lights[light])) is not None:
        pytest.skip(reason)
    camera = next(iter(world.cameras.values()))
    size = receivers.width, receivers.height
    view, trace = View(camera, *size, camera_frame(camera, *size, world)), Trace(context)
    shape = (receivers.count,) if world.casters.is_opaque else (receivers.count, 3)
    visibility: Any = wp.full(shape, np.nan, dtype=wp.float32, device="cpu")
    every = frozenset(range(len(world.casters.instances)))
    method.build(world.casters, world.lights[light], view, Changes(True, every, True), trace)
    method.shade(receivers, visibility, trace)
    found: NDArray[np.float32] = visibility.numpy().copy()
    method.close()
    return found[receivers.valid], trace


def seen(world: World, **more: int) -> Receivers:
    return render(world, next(iter(world.cameras.values())), 96, 72, Context(threads=2), **more)


def same_arrays(one: Any, other: Any) -> None:
    for field in fields(one):
        np.testing.assert_array_equal(getattr(one, field.name), getattr(other, field.name), field.name)


def is_streamed(world: World) -> bool:
    return "_flattened" not in world.__dict__ | world.casters.__dict__


@pytest.mark.parametrize("glass", [False, True])
def test_receivers_and_ground_truth(glass: bool) -> None:
    flat, streamed = both(grove(glass=glass))
    for more in ({}, {"samples": 2, "layers": 3}):
        same_arrays(seen(flat, **more), seen(streamed, **more))
    receivers = seen(flat)
    for light in flat.lights.values():
        one, other = (hard_reference(world, receivers, light, Context(threads=2)) for world in (flat, streamed))
        same_arrays(one, other)
        assert 0.1 < np.mean(one.visibility == 1.0) < 0.9
    assert is_streamed(streamed)


@pytest.mark.parametrize(("name", "values"), CASES, ids=[f"{n} {' '.join(map(str, v.values()))}" for n, v in CASES])
@pytest.mark.parametrize("light", ["sun", "lamp"])
def test_visibility_and_counters(name: str, values: dict[str, Any], light: str) -> None:
    flat, streamed = both(grove())
    receivers = seen(flat)
    expected, trace = run(flat, receivers, light, name, values)
    found, streaming = run(streamed, receivers, light, name, values)
    np.testing.assert_array_equal(found, expected)
    assert streaming.counters == trace.counters
    assert is_streamed(streamed) == (name != "embree")
    if name == "embree":
        assert streaming.kept_bytes["flattened instances"] == streamed.casters.flat().byte_count


@pytest.mark.parametrize("name", ["ray-traced", "afsm", "irregular-z-buffer"])
def test_translucent_instances(name: str) -> None:
    flat, streamed = both(grove(glass=True))
    receivers = seen(flat)
    expected, trace = run(flat, receivers, "sun", name, {})
    found, streaming = run(streamed, receivers, "sun", name, {})
    np.testing.assert_array_equal(found, expected)
    assert streaming.counters == trace.counters
    assert len(np.unique(expected)) > 5
    assert is_streamed(streamed)


def test_frames_are_fitted_to_the_same_bits() -> None:
    from shadowbench.light_space import light_frames

    flat, streamed = both(grove())
    for light in flat.lights.values():
        for one, other in zip(light_frames(light, flat), light_frames(light, streamed), strict=True):
            assert one.projection.tobytes() == other.projection.tobytes()


_FRAME = """
import numpy as np
from shadowbench.camera_pass import render
from shadowbench.device.launch import Context
from shadowbench.light_space import camera_frame
from shadowbench.method import Changes, Trace, View
from shadowbench.plugins import Registry
from shadowbench.runner.peak_memory import forget_peak, peak_bytes
from shadowbench.world import place
import warp as wp

registry, context = Registry(), Context()
grove, shadow_map = registry.scene("grove"), registry.method("shadow-map")

def frame(count):
    world = place(grove().make(grove.Parameters(instances=count, triangles=36_000)))
    camera = world.cameras["overview"]
    receivers = render(world, camera, 160, 120, context)
    method = shadow_map(shadow_map.Parameters(resolution=512), context)
    view = View(camera, 160, 120, camera_frame(camera, 160, 120, world))
    every = frozenset(range(count))
    visibility = wp.empty(receivers.count, dtype=wp.float32, device="cpu")
    method.build(world.casters, world.lights["sun"], view, Changes(True, every, True), Trace(context))
    method.shade(receivers, visibility, Trace(context))
    return world

frame(20)
forget_peak()
few = peak_bytes()
world = frame(105)
print("figures", few, peak_bytes(), world.casters.flat().byte_count)
"""


@pytest.mark.slow
def test_a_frame_of_five_times_the_instances_needs_no_more_memory() -> None:
    done = subprocess.run([sys.executable, "-c", _FRAME], capture_output=True, text=True, check=True, timeout=600)
    line = next(line for line in done.stdout.splitlines() if line.startswith("figures"))
    few, many, flat = (int(number) for number in line.split()[1:])
    # beyond what was there after 20 trees: chance in the allocator, far from the 85 trees' copies
    assert many - few < 24 << 20
    assert flat > 64 << 20
