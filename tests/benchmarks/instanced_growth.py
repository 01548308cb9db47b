"""How the cost of instanced shadow maps grows: with instances, with their triangles, and beside one map of the scene.

    python tests/benchmarks/instanced_growth.py grove --threads 2
    python tests/benchmarks/instanced_growth.py copse --plugin tests/plugins/copse.py --camera overview
    python tests/benchmarks/instanced_growth.py grove --grid --size 640x480

The scene takes its numbers of instances and of triangles an instance by the parameters named with --instances-name and
--triangles-name. In every round each scene is shaded once by `instanced` and by `shadow-map` with one map of 2048²;
what is printed are least times, medians over the rounds of each time divided by the first scene's in the same round
(so that a drifting machine hits both alike), and the counters that explain them: shading should follow the fill, that
is, what the volumes cover in the picture, and not the triangles. The last table is the paper's: frames with maps kept
(static), drawn again (dynamic), with one map of the scene, and without shadows, as frame rates relative to the last;
the paper's are 43 : 30 : 31 : 63.

With --grid there is one table instead, of shade() over all pairs of instances and triangles, after one camera pass and
one build each: instances are never copied, so that scenes of hundreds of millions of triangles fit.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import warp as wp

from shadowbench.camera_pass import CameraPass
from shadowbench.device.launch import Context
from shadowbench.light_space import camera_frame
from shadowbench.method import Changes, Method, Trace, View
from shadowbench.parameters import parse_parameters
from shadowbench.plugins import Registry
from shadowbench.world import place

ONE_MAP = {"resolution": 2048}

PAPER = {"static": 43.0, "dynamic": 30.0, "one map": 31.0, "no shadows": 63.0}
"""Frames per second of Buntin & Stamminger 2007, section 6."""


class Trial:
    """One scene, with both methods built."""

    def __init__(self, registry: Registry, arguments: argparse.Namespace, values: dict[str, Any]) -> None:
        cls = registry.scene(arguments.scene)
        world = place(cls().make(parse_parameters(cls.Parameters, values, owner=arguments.scene)))
        camera = world.cameras[arguments.camera] if arguments.camera else next(iter(world.cameras.values()))
        light = world.lights[arguments.light] if arguments.light else next(iter(world.lights.values()))
        width, height = (int(n) for n in arguments.size.split("x"))
        context = Context(threads=arguments.threads)
        self.triangle_count = world.triangle_count
        self._camera_pass = CameraPass(world, camera, width, height, context)
        self._receivers = self._camera_pass.run()
        self._visibility = wp.empty(self._receivers.count, dtype=wp.float32, device="cpu")
        self._context, self._world, self._light = context, world, light
        self._view = View(camera, width, height, camera_frame(camera, width, height, world))
        own, one_map = registry.method("instanced"), registry.method("shadow-map")
        self._own = own(own.Parameters(rotation=arguments.rotation, resolution=arguments.resolution), context)
        self._one_map = one_map(one_map.Parameters(**ONE_MAP), context)
        self.counters: dict[str, int] = {}
        self.bytes_kept = 0
        self.tasks: dict[str, Callable[[], Any]] = {
            "camera": self._camera_pass.run,
            "build": lambda: self._build(self._own),
            "shade": lambda: self._shade(self._own),
            "one map build": lambda: self._build(self._one_map),
            "one map shade": lambda: self._shade(self._one_map),
        }

    def _build(self, method: Method) -> None:
        every = frozenset(range(len(self._world.casters.instances)))
        trace = Trace(self._context)
        method.build(self._world.casters, self._light, self._view, Changes(True, every, True), trace)
        if method is self._own:
            self.bytes_kept = sum(trace.bytes_by_name().values())

    def _shade(self, method: Method) -> None:
        trace = Trace(self._context)
        method.shade(self._receivers, self._visibility, trace)
        if method is self._own:
            self.counters = trace.counters


def measured(trials: list[Trial], round_count: int, tasks: tuple[str, ...] | None = None) -> dict[str, np.ndarray]:
    """Run every task of every trial in interleaved rounds; return times [ms], shape [round, trial], by task."""
    times = {name: np.empty((round_count, len(trials))) for name in tasks or trials[0].tasks}
    for number in range(-1, round_count):  # the first round warms up
        for name, samples in times.items():
            for k, trial in enumerate(trials):
                begin = time.perf_counter()
                trial.tasks[name]()
                if number >= 0:
                    samples[number, k] = (time.perf_counter() - begin) * 1e3
    return times


def print_growth(heading: str, labels: list[str], trials: list[Trial], times: dict[str, np.ndarray]) -> None:
    """Print one row a trial."""
    print(f"\n{heading}")
    print(f"{'':>10} {'triangles':>11} {'fill':>9} {'look-ups':>9} {'build ms':>9} {'shade ms':>9} {'shade':>7} "
          f"{'fill':>7} {'one map: build ms':>18} {'shade ms':>9}")  # fmt: skip
    shade = times["shade"]
    for k, (label, trial) in enumerate(zip(labels, trials, strict=True)):
        ratio = np.median(shade[:, k] / shade[:, 0])
        fill_ratio = trial.counters["fill"] / max(1, trials[0].counters["fill"])
        print(
            f"{label:>10} {trial.triangle_count:11,} {trial.counters['fill']:9,} {trial.counters['look-ups']:9,} "
            f"{times['build'][:, k].min():9.1f} {shade[:, k].min():9.1f} {ratio:6.2f}x {fill_ratio:6.2f}x "
            f"{times['one map build'][:, k].min():18.1f} {times['one map shade'][:, k].min():9.1f}"
        )


def print_grid(labels: list[str], trials: list[Trial], times: np.ndarray) -> None:
    """Print the cost of shading, beside what the volumes cover and the triangles of the scene."""
    print("\nshade() over instances x triangles of each; ratios to the first")
    print(f"{'':>16} {'triangles':>12} {'ratio':>9} {'fill':>10} {'ratio':>7} {'look-ups':>10} {'shade ms':>9} "
          f"{'ratio':>7} {'ns a fill':>9}")  # fmt: skip
    for k, (label, trial) in enumerate(zip(labels, trials, strict=True)):
        fill, first = trial.counters["fill"], trials[0]
        print(
            f"{label:>16} {trial.triangle_count:12,} {trial.triangle_count / first.triangle_count:8.1f}x "
            f"{fill:10,} {fill / max(1, first.counters['fill']):6.2f}x {trial.counters['look-ups']:10,} "
            f"{times[:, k].min():9.1f} {np.median(times[:, k] / times[:, 0]):6.2f}x "
            f"{1e6 * times[:, k].min() / max(1, fill):9.1f}"
        )


def print_frames(label: str, trial: Trial, times: dict[str, np.ndarray], k: int) -> None:
    """Print the paper's four frame rates, relative to frames without shadows, beside the paper's own."""
    camera, build, shade = (times[name][:, k] for name in ("camera", "build", "shade"))
    one_map = times["one map build"][:, k] + times["one map shade"][:, k]
    frames = {
        "static": camera + shade,
        "dynamic": camera + build + shade,
        "one map": camera + one_map,
        "no shadows": camera,
    }
    print(f"\nframes of {label}, {trial.bytes_kept:,} bytes of maps beside {4 * ONE_MAP['resolution'] ** 2:,}")
    for name, samples in frames.items():
        share = np.median(frames["no shadows"] / samples)
        print(
            f"{name:>11}: least {samples.min():7.1f} ms, {share:5.1%} of the frame rate without shadows "
            f"(paper {PAPER[name] / PAPER['no shadows']:5.1%})"
        )
    print(f"static is {np.median(frames['one map'] / frames['static']):.2f} times as fast as one map drawn every frame")


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene", help="a scene's name")
    parser.add_argument("--plugin", type=Path, action="append", default=[], help="a file that has the scene")
    parser.add_argument("--instances-name", default="instances")
    parser.add_argument("--triangles-name", default="triangles")
    parser.add_argument("--instances", type=int, nargs="+", default=[1, 10, 105, 1000])
    parser.add_argument("--triangles", type=int, nargs="+", default=[1_000, 36_000, 360_000])
    parser.add_argument("--fixed-instances", type=int, default=10, help="while triangles grow")
    parser.add_argument("--fixed-triangles", type=int, default=1_000, help="while instances grow")
    parser.add_argument("--frame-instances", type=int, default=105, help="in the table of frames")
    parser.add_argument("--frame-triangles", type=int, default=36_000, help="of an instance in the table of frames")
    parser.add_argument(
        "--most-triangles", type=int, default=8_000_000, help="in all; scenes that have more are left out"
    )
    parser.add_argument("--light")
    parser.add_argument("--camera")
    parser.add_argument("--size", default="1024x768")
    parser.add_argument("--rotation", default="interpolated-depth")
    parser.add_argument("--resolution", type=int, default=512)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--rounds", type=int, default=9)
    parser.add_argument("--grid", action="store_true", help="only shade(), over all pairs")
    arguments = parser.parse_args()
    registry = Registry(tuple(arguments.plugin))

    def trials_of(pairs: list[tuple[int, int]]) -> tuple[list[str], list[Trial]]:
        kept = [pair for pair in pairs if pair[0] * pair[1] <= arguments.most_triangles]
        names = arguments.instances_name, arguments.triangles_name
        return (
            [f"{count:,} x {triangles:,}" for count, triangles in kept],
            [Trial(registry, arguments, dict(zip(names, pair, strict=True))) for pair in kept],
        )

    print(f"{arguments.scene}, {arguments.size}, {arguments.threads} thread(s), {arguments.rounds} interleaved rounds")
    if arguments.grid:
        labels, trials = trials_of([(n, t) for n in arguments.instances for t in arguments.triangles])
        for trial in trials:
            trial.tasks["build"]()
        print_grid(labels, trials, measured(trials, arguments.rounds, ("shade",))["shade"])
        return
    labels, trials = trials_of([(count, arguments.fixed_triangles) for count in arguments.instances])
    print_growth("instances grow", labels, trials, measured(trials, arguments.rounds))
    labels, trials = trials_of([(arguments.fixed_instances, count) for count in arguments.triangles])
    print_growth("triangles grow", labels, trials, measured(trials, arguments.rounds))
    labels, trials = trials_of([(arguments.frame_instances, arguments.frame_triangles)])
    for label, trial in zip(labels, trials, strict=True):
        print_frames(label, trial, measured([trial], arguments.rounds), 0)


if __name__ == "__main__":
    main()
