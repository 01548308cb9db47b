"""Exact rasterising methods against Embree, on the same receivers, in the same interleaved rounds.

    python tests/benchmarks/exact_methods_against_embree.py --triangles 1000 10000 --threads 1 --rounds 7
    python tests/benchmarks/exact_methods_against_embree.py --triangles 1000000 --view horizon

Random triangles, sun, 1024x768. A method's time is build() + shade(), since casters move every frame; Embree's is its
stages *BVH construction* and *shadow rays*, without the binding's buffer copy and the making of rays. Prints the least
times and the median over the rounds of each method's time divided by Embree's, which is what the project promises, and
by Embree's rays alone.

``--view horizon`` is the worst case for strips of receivers: a ground seen from just above it, up to 600 times as far
away at the picture's top as at its bottom, so that almost all receivers crowd into a sliver of the light's window.
"""

from __future__ import annotations

import argparse
import math
import os
import time

import numpy as np
import warp as wp

from shadowbench.camera_pass import CameraPass
from shadowbench.device.launch import Context
from shadowbench.light_space import camera_frame
from shadowbench.method import Changes, Method, Trace, View
from shadowbench.methods.afsm import AliasFreeShadowMaps
from shadowbench.methods.embree import Embree
from shadowbench.methods.irregular_z_buffer import IrregularZBuffer
from shadowbench.receivers import Receivers
from shadowbench.reference import hard_reference
from shadowbench.scene import Camera
from shadowbench.scenes.random_triangles import CAMERAS, TOTAL_AREA, RandomTriangles
from shadowbench.world import World, place

METHODS: tuple[type[Method], ...] = (Embree, AliasFreeShadowMaps, IrregularZBuffer)

EYE_HEIGHT, HALF_ANGLE, FARTHEST = 0.8, 20.0, 600.0
DOWN = math.radians(HALF_ANGLE) + EYE_HEIGHT / FARTHEST
"""How far the camera of ``horizon`` looks down: its uppermost rays still meet the ground, ``FARTHEST`` away."""

VIEWS = {
    "middle": (8.0, CAMERAS["middle"]),
    "horizon": (
        2000.0,
        Camera(
            eye=(0.0, EYE_HEIGHT, 1.5),
            target=(0.0, EYE_HEIGHT - math.sin(DOWN), 1.5 - math.cos(DOWN)),
            vertical_angle=2.0 * HALF_ANGLE,
        ),
    ),
}
"""Side of the ground, and camera."""


def main() -> None:
    arguments = _arguments()
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, sorted(os.sched_getaffinity(0))[-arguments.threads :])
    context = Context(threads=arguments.threads)
    ground, camera = VIEWS[arguments.view]
    for triangle_count in arguments.triangles:
        scene = RandomTriangles().make(
            RandomTriangles.Parameters(triangles=triangle_count, ground=ground, area=arguments.area)
        )
        world = place(scene)
        receivers = CameraPass(world, camera, 1024, 768, context).run()
        view = View(camera, 1024, 768, camera_frame(camera, 1024, 768, world))
        truth = hard_reference(world, receivers, world.lights["sun"], context).visibility
        print(f"{triangle_count} triangles, {receivers.count} receivers, {arguments.threads} thread(s)")
        _compare(world, receivers, view, truth, context, arguments.rounds)


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--triangles", type=int, nargs="+", default=[1_000, 10_000, 100_000, 1_000_000])
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--area", type=float, default=TOTAL_AREA, help="of all triangles; more means more cover")
    parser.add_argument("--view", choices=VIEWS, default="middle")
    return parser.parse_args()


def _compare(
    world: World, receivers: Receivers, view: View, truth: np.ndarray, context: Context, round_count: int
) -> None:
    methods = [method(method.Parameters(), context) for method in METHODS]
    times = np.empty((round_count, len(methods)))
    rays = np.empty(round_count)
    traces = [Trace(context) for _ in methods]
    everything = frozenset(range(len(world.casters.instances)))
    for number in range(-1, round_count):  # the first round warms up
        changes = Changes(light=number < 0, instances=everything, view=False)
        for k, method in enumerate(methods):
            trace = Trace(context)
            visibility = wp.empty(receivers.count, dtype=wp.float32, device=context.device)
            begin = time.perf_counter()
            method.build(world.casters, world.lights["sun"], view, changes, trace)
            method.shade(receivers, visibility, trace)
            elapsed = (time.perf_counter() - begin) * 1e3
            if isinstance(method, Embree):
                elapsed = trace.stages["BVH construction"] + trace.stages["shadow rays"]
                rays[number] = trace.stages["shadow rays"]
            if number >= 0:
                if elapsed <= times[:number, k].min(initial=np.inf):
                    traces[k] = trace
                times[number, k] = elapsed
            elif not isinstance(method, Embree) and not np.array_equal(visibility.numpy(), truth):
                print(f"  {method.name} differs from the reference")
    for k, method in enumerate(methods):
        of_all, of_rays = (np.median(times[:, k] / theirs) for theirs in (times[:, 0], rays))
        stages = ", ".join(f"{name} {value:.1f}" for name, value in traces[k].stages.items())
        ratios = f"of Embree's {of_all:.3f}, of its rays {of_rays:.3f}"
        print(f"  {method.name:20} least {times[:, k].min():8.1f} ms   {ratios}   ({stages})")
        method.close()


if __name__ == "__main__":
    main()
