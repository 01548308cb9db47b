"""How much two threads are worth: rasteriser, camera pass and look-ups, one thread against several in one run.

    python tests/benchmarks/thread_scaling.py [--triangles 10000 1000000] [--threads 2] [--size 1024x768]

Every round times each part on one thread and on several, in turn, so that a drifting machine hits both alike; printed
are the medians and the median of the per-round ratios. On a machine with other work on its cores the ratio says more
about that work than about this program.
"""

import argparse
import statistics
import time
from collections.abc import Callable, Iterator

import numpy as np
import warp as wp

from shadowbench.camera_pass import CameraPass
from shadowbench.device.depth_rasterizer import DepthRasterizer
from shadowbench.light_space import camera_frame, light_frames
from shadowbench.method import Changes, Context, Trace, View
from shadowbench.plugins import Registry
from shadowbench.receivers import Receivers
from shadowbench.world import World, place


def parts(world: World, receivers: Receivers, threads: int) -> Iterator[tuple[str, Callable[[], object]]]:
    """Yield each part's name and a function that runs it once."""
    context = Context(threads=threads)
    camera = next(iter(world.cameras.values()))
    light = next(iter(world.lights.values()))
    (frame,) = light_frames(light, world)
    triangles = world.on("cpu")
    for resolution in (512, 1024, 2048):
        rasterizer = DepthRasterizer(resolution, resolution, context)

        def draw(rasterizer: DepthRasterizer = rasterizer) -> None:
            rasterizer.clear()
            rasterizer.draw(triangles.vertices, triangles.triangles, frame.projection, near=None)

        yield f"depth map {resolution}²", draw
    yield "camera pass", CameraPass(world, camera, receivers.width, receivers.height, context).run
    view = View(
        camera,
        receivers.width,
        receivers.height,
        camera_frame(camera, receivers.width, receivers.height, world),
    )
    everything = Changes(light=True, instances=frozenset(range(len(world.casters.instances))), view=True)
    visibility = wp.zeros(receivers.count, dtype=wp.float32, device="cpu")
    for name, values in (("shadow-map", {}), ("pcf", {"kernel": 3}), ("pcf", {"kernel": 7}), ("ray-traced", {})):
        cls = Registry().method(name)
        parameters = cls.Parameters(**values)
        method = cls(parameters, context)
        method.build(world.casters, light, view, everything, Trace(context))

        def shade(method=method, context=context) -> None:
            method.shade(receivers, visibility, Trace(context))

        yield f"look-up: {name} {values or ''}".rstrip(), shade


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--triangles", type=int, nargs="+", default=[10_000, 1_000_000])
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--size", default="1024x768")
    parser.add_argument("--rounds", type=int, default=11)
    arguments = parser.parse_args()
    width, height = (int(n) for n in arguments.size.split("x"))
    scene = Registry().scene("random-triangles")()
    for triangle_count in arguments.triangles:
        world = place(scene.make(scene.Parameters(triangles=triangle_count)))
        receivers = CameraPass(world, next(iter(world.cameras.values())), width, height, Context()).run()
        print(f"\n{triangle_count:,} triangles, {receivers.count:,} receivers: 1 thread, {arguments.threads}, ratio")
        single = dict(parts(world, receivers, 1))
        several = dict(parts(world, receivers, arguments.threads))
        for name, run in single.items():
            seconds: dict[int, list[float]] = {1: [], arguments.threads: []}
            for _ in range(arguments.rounds + 1):
                for threads, task in ((1, run), (arguments.threads, several[name])):
                    begin = time.perf_counter()
                    task()
                    seconds[threads].append(time.perf_counter() - begin)
            one, more = (np.array(s[1:]) * 1e3 for s in seconds.values())  # the first round warms up
            ratio = statistics.median(one / more)
            print(f"  {name:34s} {np.median(one):9.2f} ms {np.median(more):9.2f} ms   {ratio:5.2f}x")


if __name__ == "__main__":
    main()
