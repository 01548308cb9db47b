"""How many receivers the exact methods decide otherwise than the ray-traced ground truth: none, everywhere.

    python tests/benchmarks/exactness.py
    python tests/benchmarks/exactness.py --scenes random-triangles:triangles=1000000 --size 1024x768

Every scene that shadowbench ships, random triangles at 1 K, 10 K, 100 K and 1 M, under each of their lights, seen by
each of their cameras, on one thread and on two: `afsm`, its brute-force mode (as many receivers of the picture as 10^10
tests allow) and `irregular-z-buffer` in both layouts, compared bit for bit. Exits with 1 if any receiver differs.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from dataclasses import fields, replace

import numpy as np
import warp as wp
from numpy.typing import NDArray

from shadowbench.camera_pass import render
from shadowbench.device.launch import Context
from shadowbench.experiment import parse_choice, parse_size
from shadowbench.light_space import camera_frame
from shadowbench.method import Changes, Method, Trace, View
from shadowbench.methods.afsm import AliasFreeShadowMaps
from shadowbench.methods.irregular_z_buffer import IrregularZBuffer
from shadowbench.parameters import parse_parameters
from shadowbench.plugins import Registry
from shadowbench.receivers import Receivers
from shadowbench.reference import hard_reference
from shadowbench.scene import RectangularLight
from shadowbench.world import World, place

METHODS: dict[str, tuple[type[Method], dict[str, object]]] = {
    "afsm": (AliasFreeShadowMaps, {}),
    "afsm brute-force": (AliasFreeShadowMaps, {"traversal": "brute-force"}),
    "irregular-z-buffer": (IrregularZBuffer, {}),
    "irregular-z-buffer uniform": (IrregularZBuffer, {"layout": "uniform"}),
}

MOST_TESTS = 10**10
"""Of brute force; beyond, an even share of the receivers is asked."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", nargs="+", help="as for shadowbench run; by default all that ship")
    parser.add_argument("--size", default="640x480")
    arguments = parser.parse_args()
    registry, wrong = Registry(), 0
    for text in arguments.scenes or list(_all_scenes(registry)):
        choice = parse_choice(text)
        plugin = registry.scene(choice.name)
        for values in choice.expand():
            made = plugin().make(parse_parameters(plugin.Parameters, values, owner=f"scene '{choice.name}'"))
            wrong += _compare(text, place(made), parse_size(arguments.size))
    print(f"{wrong} receivers differ")
    sys.exit(wrong > 0)


def _all_scenes(registry: Registry) -> Iterator[str]:
    for name in registry.names("scene"):
        if name == "random-triangles":
            yield from (f"{name}:triangles={count}" for count in (1_000, 10_000, 100_000, 1_000_000))
        elif name != "mesh-file":
            yield name


def _compare(scene: str, world: World, size: tuple[int, int]) -> int:
    wrong = 0
    for camera_name, camera in world.cameras.items():
        receivers = render(world, camera, *size, Context(threads=2))
        for light_name, light in world.lights.items():
            if isinstance(light, RectangularLight):
                continue
            truth = hard_reference(world, receivers, light, Context(threads=2)).visibility
            view = View(camera, *size, camera_frame(camera, *size, world))
            told = []
            for name, (cls, parameters) in METHODS.items():
                asked = _share(receivers, world.casters.triangle_count) if "brute" in name else slice(None)
                for threads in (1, 2):
                    differing = _differing(cls, parameters, world, light_name, view, receivers, truth, asked, threads)
                    told.append(f"{name}/{threads}: {differing}")
                    wrong += differing
            print(f"{scene}, {light_name}, {camera_name}, {receivers.count} receivers, differing: {', '.join(told)}")
    return wrong


def _share(receivers: Receivers, triangles: int) -> slice:
    return slice(None, None, max(1, -(-receivers.count * triangles // MOST_TESTS)))


def _differing(
    cls: type[Method],
    parameters: dict[str, object],
    world: World,
    light: str,
    view: View,
    receivers: Receivers,
    truth: NDArray[np.float32],
    asked: slice,
    threads: int,
) -> int:
    context = Context(threads=threads)
    if asked != slice(None):
        of_receiver = {f.name for f in fields(receivers)} - {"width", "height", "eye", "first_of_pixel"}
        arrays = {name: np.ascontiguousarray(getattr(receivers, name)[asked]) for name in of_receiver}
        receivers = replace(receivers, **arrays)
    method = cls(cls.Parameters(**parameters), context)
    visibility = wp.full(truth[asked].shape, value=np.nan, dtype=wp.float32, device="cpu")
    everything = frozenset(range(len(world.casters.instances)))
    method.build(world.casters, world.lights[light], view, Changes(True, everything, True), Trace(context))
    method.shade(receivers, visibility, Trace(context))
    return int(np.any((visibility.numpy() != truth[asked]).reshape(receivers.count, -1), axis=1).sum())


if __name__ == "__main__":
    main()
