"""Exact rasterising methods against Embree, on the same receivers, in the same interleaved rounds.

    python tests/benchmarks/exact_methods_against_embree.py --triangles 1000 10000 --threads 1 --rounds 7

Random triangles, sun, 1024x768. A method's time is build() + shade(), since casters move every frame; Embree's is its
stages *BVH construction* and *shadow rays*, without the binding's buffer copy and the making of rays. Prints the least
times and the median over the rounds of each method's time divided by Embree's, which is what the project promises.
"""

from __future__ import annotations

import argparse
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
from shadowbench.scenes.random_triangles import RandomTriangles
from shadowbench.world import World, place

METHODS: tuple[type[Method], ...] = (Embree, AliasFreeShadowMaps, IrregularZBuffer)


def main() -> None:
    arguments = _arguments()
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, sorted(os.sched_getaffinity(0))[-arguments.threads :])
    context = Context(threads=arguments.threads)
    for triangle_count in arguments.triangles:
        scene = RandomTriangles().make(RandomTriangles.Parameters(triangles=triangle_count))
        world = place(scene)
        camera = world.cameras["middle"]
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
    return parser.parse_args()


def _compare(
    world: World, receivers: Receivers, view: View, truth: np.ndarray, context: Context, round_count: int
) -> None:
    methods = [method(method.Parameters(), context) for method in METHODS]
    times = np.empty((round_count, len(methods)))
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
            if number >= 0:
                if elapsed <= times[:number, k].min(initial=np.inf):
                    traces[k] = trace
                times[number, k] = elapsed
            elif not isinstance(method, Embree) and not np.array_equal(visibility.numpy(), truth):
                print(f"  {method.name} differs from the reference")
    for k, method in enumerate(methods):
        ratio = np.median(times[:, k] / times[:, 0])
        stages = ", ".join(f"{name} {value:.1f}" for name, value in traces[k].stages.items())
        print(f"  {method.name:20} least {times[:, k].min():8.1f} ms   of Embree's {ratio:.3f}   ({stages})")
        method.close()


if __name__ == "__main__":
    main()
