"""The ray tracers and the ground truth against Embree, on the same receivers, in the same interleaved rounds.

    python tests/benchmarks/tracers_against_embree.py --triangles 1000 10000 --threads 1 --rounds 7

Random triangles, sun, 1024x768. Prints each tracer's stages at their least over the rounds, the median over the rounds
of its time for shadow rays divided by Embree's, and on how many receivers tracers of the same rays differ.
"""

from __future__ import annotations

import argparse
import os
import time
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from shadowbench.camera_pass import CameraPass
from shadowbench.device.launch import Context
from shadowbench.light_space import camera_frame
from shadowbench.method import Changes, Method, Trace, View
from shadowbench.methods.embree import Embree, EmbreeParameters
from shadowbench.methods.ray_traced import RayTraced, RayTracedParameters
from shadowbench.receivers import Receivers
from shadowbench.reference import hard_reference
from shadowbench.scenes.random_triangles import RandomTriangles
from shadowbench.world import World, place


def main() -> None:
    arguments = _arguments()
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, sorted(os.sched_getaffinity(0))[-arguments.threads :])
    context = Context(threads=arguments.threads)
    for triangle_count in arguments.triangles:
        world = place(RandomTriangles().make(RandomTriangles.Parameters(triangles=triangle_count)))
        camera = world.cameras["middle"]
        receivers = CameraPass(world, camera, 1024, 768, context).run()
        view = View(camera, 1024, 768, camera_frame(camera, 1024, 768, world))
        print(f"{triangle_count} triangles, {receivers.count} receivers, {arguments.threads} thread(s)")
        _compare(world, receivers, view, context, arguments.rounds)


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--triangles", type=int, nargs="+", default=[1_000, 10_000, 100_000, 1_000_000])
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--rounds", type=int, default=7)
    return parser.parse_args()


def _compare(world: World, receivers: Receivers, view: View, context: Context, round_count: int) -> None:
    light = world.lights["sun"]
    methods: dict[str, Method] = {
        "embree": Embree(EmbreeParameters(), context),
        "offset": RayTraced(RayTracedParameters(self_hit="offset"), context),
        "plane": RayTraced(RayTracedParameters(self_hit="plane"), context),
    }
    stages: dict[str, list[dict[str, float]]] = {name: [] for name in methods}
    truth_times = []
    shown: dict[str, NDArray[np.float32]] = {}
    for number in range(-1, round_count):  # the first round warms up
        changes = Changes(light=number < 0, instances=frozenset({0}), view=False)
        for name, method in methods.items():
            trace = Trace(context)
            visibility: Any = wp.empty(receivers.count, dtype=wp.float32, device=context.device)
            method.build(world.casters, light, view, changes, trace)
            method.shade(receivers, visibility, trace)
            shown[name] = visibility.numpy()
            if number >= 0:
                stages[name].append(trace.stages)
        begin = time.perf_counter()
        truth = hard_reference(world, receivers, light, context)
        if number >= 0:
            truth_times.append((time.perf_counter() - begin) * 1e3)
    for name, method in methods.items():
        ratio = np.median(
            [a["shadow rays"] / b["shadow rays"] for a, b in zip(stages[name], stages["embree"], strict=True)]
        )
        least = {stage: min(s[stage] for s in stages[name]) for stage in stages[name][0]}
        text = ", ".join(f"{stage} {value:.1f}" for stage, value in least.items())
        print(f"  {name:8} rays of Embree's {ratio:.2f}   ({text}) ms")
        method.close()
    print(f"  ground truth, with its tree: {min(truth_times):.0f} ms")
    scored = truth.in_field & ~truth.turned_away
    print(f"  offset differs from embree on {np.count_nonzero(shown['offset'] != shown['embree'])} receivers")
    print(f"  plane differs from the truth on {np.count_nonzero(shown['plane'] != truth.visibility)} receivers")
    print(f"  embree fails on {100 * np.mean((shown['embree'] != truth.visibility)[scored]):.3f} % of scored receivers")


if __name__ == "__main__":
    main()
