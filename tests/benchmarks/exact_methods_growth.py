"""How the exact rasterising methods grow: a straight line through logarithms of time, over triangles and receivers.

    python tests/benchmarks/exact_methods_growth.py --threads 1 --rounds 5

Random triangles, sun, view ``middle``. Over 1 K to 4 M triangles of the same total area the stage *rasterization* is
fitted, at 1024x768; over 0.25 to 8 M receivers build() + shade(), at 100 K triangles. The exponent is the slope: 1 is
proportional. The alias-free paper's own table gives 0.59 for rasterization over 1 K to 1 M. Last, 100 K triangles of
growing total area: the paper says that larger triangles of the same count are faster, since they hide more.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence

import numpy as np
import warp as wp

from shadowbench.camera_pass import CameraPass
from shadowbench.device.launch import Context
from shadowbench.light_space import camera_frame
from shadowbench.method import Changes, Method, Trace, View
from shadowbench.methods.afsm import AliasFreeShadowMaps
from shadowbench.methods.irregular_z_buffer import IrregularZBuffer
from shadowbench.scenes.random_triangles import TOTAL_AREA, RandomTriangles
from shadowbench.world import World, place

METHODS: tuple[type[Method], ...] = (AliasFreeShadowMaps, IrregularZBuffer)
TRIANGLES = (1_000, 4_000, 16_000, 64_000, 256_000, 1_000_000, 4_000_000)
AREAS = (0.7, 2.0, 7.0, 20.0, 70.0)
SIZES = ((576, 432), (816, 612), (1152, 864), (1632, 1224), (2304, 1728), (3264, 2448))
PAPER = ((1e3, 145.0), (1e4, 381.0), (1e5, 1568.0), (1e6, 8102.0))
"""Aila & Laine 2004, Table 1: triangles and rasterization [ms]."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--rounds", type=int, default=5)
    arguments = parser.parse_args()
    context = Context(threads=arguments.threads)
    print(f"the paper: rasterization grows with triangles^{_slope(*zip(*PAPER, strict=True)):.2f}")
    over_triangles = {count: _least(_world(count), (1024, 768), context, arguments.rounds) for count in TRIANGLES}
    world = _world(100_000)
    over_areas = {area: _least(_world(100_000, area), (1024, 768), context, arguments.rounds) for area in AREAS}
    over_receivers = {w * h: _least(world, (w, h), context, arguments.rounds) for w, h in SIZES}
    for method in METHODS:
        raster = [found[method.name]["rasterization"] for found in over_triangles.values()]
        total = [sum(found[method.name].values()) for found in over_receivers.values()]
        print(f"{method.name}, {arguments.threads} thread(s)")
        _tell("rasterization [ms] over triangles", TRIANGLES, raster)
        _tell("all stages [ms] over receivers", tuple(over_receivers), total)
        _tell("rasterization [ms] over area", AREAS, [f[method.name]["rasterization"] for f in over_areas.values()])


def _world(triangles: int, area: float = TOTAL_AREA) -> World:
    return place(RandomTriangles().make(RandomTriangles.Parameters(triangles=triangles, area=area)))


def _least(world: World, size: tuple[int, int], context: Context, rounds: int) -> dict[str, dict[str, float]]:
    """Return each stage's least duration [ms] by method, the methods taking turns."""
    camera = world.cameras["middle"]
    receivers = CameraPass(world, camera, *size, context).run()
    view = View(camera, *size, camera_frame(camera, *size, world))
    visibility = wp.empty(receivers.count, dtype=wp.float32, device=context.device)
    methods = [method(method.Parameters(), context) for method in METHODS]
    found: dict[str, dict[str, float]] = {method.name: {} for method in methods}
    for number in range(rounds + 1):
        for method in methods:
            trace = Trace(context)
            method.build(world.casters, world.lights["sun"], view, Changes(number == 0, frozenset((0,)), False), trace)
            method.shade(receivers, visibility, trace)
            for stage, duration in trace.stages.items():
                if number > 0:
                    found[method.name][stage] = min(duration, found[method.name].get(stage, np.inf))
    return found


def _slope(x: Sequence[float], y: Sequence[float]) -> float:
    return float(np.polyfit(np.log(x), np.log(y), 1)[0])


def _tell(what: str, x: Sequence[float], y: Sequence[float]) -> None:
    pairs = ", ".join(f"{count}: {value:.1f}" for count, value in zip(x, y, strict=True))
    print(f"  {what}: {pairs}\n    exponent {_slope(x, y):.2f}")


if __name__ == "__main__":
    main()
