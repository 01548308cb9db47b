"""Whole dynamic frames of one of our methods against the same through OpenGL, stage by stage, in the same rounds.

    python tests/benchmarks/frames_against_opengl.py --threads 1 2 \\
        --ours esm:kernel=7,resolution=2048 --theirs opengl-esm:kernel=7,resolution=2048

A frame is build() + shade(): light and casters moved, so the map is drawn, filtered and looked up. Frames alternate
between the two; a ratio is the median of the rounds' ratios, with their quartiles. OpenGL's transfers (*caster upload*,
*receiver upload*, *read-back*) are in the first ratio and left out of the second. Each number of threads has a process
of its own, since Mesa's llvmpipe reads it once; processors are not pinned. How far the two results differ is printed
too: they do the same only if the options say so.
"""

from __future__ import annotations

import argparse
import statistics
import subprocess
import sys
import time
from typing import Any

import numpy as np
import warp as wp

from shadowbench.camera_pass import render
from shadowbench.device.launch import Context
from shadowbench.errors import ShadowbenchError
from shadowbench.experiment import parse_choice, parse_size
from shadowbench.light_space import camera_frame
from shadowbench.method import Changes, Method, Trace, View
from shadowbench.parameters import parse_parameters
from shadowbench.plugins import Registry
from shadowbench.world import World, place

TRANSFERS = ("caster upload", "receiver upload", "read-back")

Frame = tuple[float, dict[str, float], Any]
"""Duration [ms], stages [ms], visibility."""


def main() -> None:
    arguments = _arguments()
    if arguments.only is not None:
        _compare(arguments, arguments.only)
        return
    for threads in arguments.threads:
        ended = subprocess.run([sys.executable, *sys.argv, "--only", str(threads)], check=False)
        if ended.returncode:
            sys.exit(ended.returncode)


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--ours", default="pcf:filter=bilinear,resolution=2048", help="a method and its parameters")
    parser.add_argument("--theirs", default="opengl-shadow-map:resolution=2048", help="a method of the peer, likewise")
    parser.add_argument("--scene", default="bunny", help="a scene and its parameters, or a mesh file")
    parser.add_argument("--light", help="a light of the scene; its first if not given")
    parser.add_argument("--camera", help="a camera of the scene; its first if not given")
    parser.add_argument("--size", default="1024x768", help="of the picture")
    parser.add_argument("--threads", type=int, nargs="+", default=[1, 2])
    parser.add_argument("--rounds", type=int, default=15)
    parser.add_argument("--only", type=int, help=argparse.SUPPRESS)
    return parser.parse_args()


def _compare(arguments: argparse.Namespace, threads: int) -> None:
    context = Context(threads=threads)
    try:
        world = _world(arguments.scene)
        methods = [_method(text, context) for text in (arguments.ours, arguments.theirs)]
        width, height = parse_size(arguments.size)
    except ShadowbenchError as error:
        sys.exit(str(error))
    light = world.lights[arguments.light or next(iter(world.lights))]
    camera = world.cameras[arguments.camera or next(iter(world.cameras))]
    receivers = render(world, camera, width, height, context)
    view = View(camera, width, height, camera_frame(camera, width, height, world))
    changes = Changes(light=True, instances=frozenset(range(len(world.casters.instances))), view=True)
    for method in methods:
        if (reason := method.supports(world, light)) is not None:
            sys.exit(f"{method.name}: {reason}")

    def frame(method: Method) -> Frame:
        trace = Trace(context)
        visibility = wp.empty(receivers.count, dtype=wp.float32, device="cpu")
        begin = time.perf_counter()
        method.build(world.casters, light, view, changes, trace)
        method.shade(receivers, visibility, trace)
        return (time.perf_counter() - begin) * 1.0e3, trace.stages, visibility.numpy()

    for method in methods:  # compile and warm up
        frame(method)
    rounds = [[frame(method) for method in methods] for _ in range(arguments.rounds)]

    print(f"\n{arguments.scene}: {world.triangle_count} triangles, {receivers.count} receivers")
    print(f"threads: {threads}; {arguments.rounds} rounds")
    for k, (text, method) in enumerate(zip((arguments.ours, arguments.theirs), methods, strict=True)):
        print(f"{text}  {method.library_versions().get('OpenGL renderer', '')}".rstrip())
        durations = {name: [pair[k][1][name] for pair in rounds] for name in rounds[0][k][1]}
        for name, samples in (durations | {"frame": [pair[k][0] for pair in rounds]}).items():
            print(f"    {name:24}{statistics.median(samples):9.2f} ms")
    for label, left_out in (("theirs / ours", ()), ("theirs / ours, without transfers", TRANSFERS)):
        ratios = [_without(theirs, left_out) / _without(ours, left_out) for ours, theirs in rounds]
        low, middle, high = np.quantile(ratios, (0.25, 0.5, 0.75))
        print(f"{label}: {middle:.2f} [{low:.2f}, {high:.2f}]")
    ours, theirs = (found[receivers.valid] for _, _, found in rounds[-1])
    apart = np.abs(ours - theirs)
    print(f"visibility: mean difference {apart.mean():.5f}, {(apart > 1 / 16).sum()} receivers over 1/16")
    for method in methods:
        method.close()


def _without(frame: Frame, stages: tuple[str, ...]) -> float:
    duration, durations, _ = frame
    return duration - sum(durations.get(name, 0.0) for name in stages)


def _world(text: str) -> World:
    choice = parse_choice(text)
    name, values = choice.name, next(choice.expand())
    if choice.is_mesh_file:
        name, values = "mesh-file", values | {"path": choice.name}
    plugin = Registry().scene(name)
    return place(plugin().make(parse_parameters(plugin.Parameters, values, owner=f"scene '{name}'")))


def _method(text: str, context: Context) -> Method:
    choice = parse_choice(text)
    cls = Registry().method(choice.name)
    if (reason := cls.available()) is not None:
        sys.exit(reason)
    return cls(parse_parameters(cls.Parameters, next(choice.expand()), owner=f"method '{choice.name}'"), context)


if __name__ == "__main__":
    main()
