"""What the harness itself costs: inside build and shade, and around a case.

    python tests/benchmarks/harness_cost.py [--frames 200] [--cases 500] [--size 640x480] [--profile]

*Inside*: the stages, counters and kept arrays that a method reports, as a share of its build + shade. Methods build and
shade a scene as the harness has them do, with a trace and with one that takes note of nothing, in turn; printed is the
median over the pairs of frames of one over the other. It should be below 1.02.

*Around*: what a case takes from its planning to its durable row, in a sweep of a method that does nothing, through the
real runner and store. With ``--profile`` the runner's own process is profiled.
"""

from __future__ import annotations

import argparse
import cProfile
import pstats
import shutil
import tempfile
import time
from collections import Counter
from contextlib import nullcontext
from pathlib import Path

import numpy as np
import warp as wp

from shadowbench import runner
from shadowbench.camera_pass import CameraPass
from shadowbench.choices import Choice, size_of
from shadowbench.device.launch import Context
from shadowbench.experiment import Comparison, Experiment
from shadowbench.light_space import camera_frame
from shadowbench.method import Changes, Trace, View
from shadowbench.plugins import Registry
from shadowbench.runner import RunOptions
from shadowbench.statistics import ratio_by_round
from shadowbench.store import Store
from shadowbench.world import place

PLUGINS = Path(__file__).parent.parent / "plugins"
METHODS = ("shadow-map", "pcf", "vsm", "irregular-z-buffer", "instanced")


class Silent(Trace):
    """Takes note of nothing, as quickly as that can be done."""

    def stage(self, name):
        return nullcontext()

    def count(self, name, value):
        pass

    def mask(self, name, values):
        pass

    def keep(self, name, array):
        pass

    def keep_bytes(self, name, byte_count):
        pass


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--frames", type=int, default=200)
    parser.add_argument("--cases", type=int, default=500)
    parser.add_argument("--size", type=size_of, default=(640, 480))
    parser.add_argument("--profile", action="store_true")
    arguments = parser.parse_args()
    if arguments.frames:
        _inside(arguments.frames, *arguments.size)
    if arguments.cases:
        _around(arguments.cases, profile=arguments.profile)


def _inside(frame_count, width, height):
    registry, context = Registry(), Context("cpu", 1)
    scene = registry.scene("bunny")
    world = place(scene().make(scene.Parameters()))
    camera = next(iter(world.cameras.values()))
    receivers = CameraPass(world, camera, width, height, context).run()
    view = View(camera, width, height, camera_frame(camera, width, height, world))
    light = next(iter(world.lights.values()))
    everything = Changes(light=True, instances=frozenset(range(len(world.casters.instances))), view=True)
    visibility = wp.empty(receivers.count, dtype=wp.float32, device="cpu")
    for name in METHODS:
        cls = registry.method(name)
        method = cls(cls.Parameters(), context)
        durations = {Trace: [], Silent: []}
        for number in range(-3, frame_count):
            kinds = list(durations)[:: 1 if number % 2 else -1]
            for kind in kinds:
                begin = time.perf_counter()
                trace = kind(context)
                method.build(world.casters, light, view, everything, trace)
                method.shade(receivers, visibility, trace)
                if number >= 0:
                    durations[kind].append((time.perf_counter() - begin) * 1e3)
        found = ratio_by_round(durations[Trace], durations[Silent])
        print(
            f"{name}: {np.median(durations[Silent]):.2f} ms without a trace; "
            f"with one [{found.low:.4f}, {found.estimate:.4f}, {found.high:.4f}] times as long",
            flush=True,
        )
        method.close()


class _Phases:
    """An observer that adds up the time between two things that it is told."""

    def __init__(self):
        self.spent, self._since, self._phase = Counter(), time.perf_counter(), "plan"

    def planned(self, plan, remaining):
        self._enter("begin")

    def case_started(self, case, phase):
        self._enter(phase.split()[0] if phase.startswith("round") else phase)

    def row_finished(self, row):
        self._enter("after a row")

    def note(self, text):
        pass

    def _enter(self, phase):
        now = time.perf_counter()
        self.spent[self._phase] += now - self._since
        self._phase, self._since = phase, now


def _around(case_count, *, profile):
    folder = Path(tempfile.mkdtemp(prefix="harness-cost-"))
    values = tuple(range(1, case_count + 1))
    comparison = Comparison((Choice("tiny"),), (Choice("arithmetic-free", {"number": values}),), sizes=((64, 48),))
    options = RunOptions(
        results=folder,
        threads=(1,),
        plugin_files=(PLUGINS / "tiny_scene.py", PLUGINS / "arithmetic.py"),
    )
    phases, profiler = _Phases(), cProfile.Profile() if profile else None
    try:
        begin = time.perf_counter()
        plan = runner.plan([Experiment("sweep", "sweep", (comparison,))], options)
        planned = time.perf_counter()
        with Store.open(folder) as store:
            if profiler is not None:
                profiler.enable()
            record = runner.run(plan, store, phases)
            if profiler is not None:
                profiler.disable()
            end = time.perf_counter()
            rows = store.rows(record.run_id)
        assert len(rows) == case_count
        assert {row.outcome.value for row in rows} == {"ok"}
        print(
            f"{case_count} cases that do nothing: {(end - begin) / case_count * 1e3:.0f} ms each, of which planning "
            f"{(planned - begin) / case_count * 1e3:.1f} ms; "
            f"{rows[0].rounds} rounds, {rows[0].processes} process"
        )
        for phase, spent in phases.spent.most_common():
            print(f"  {phase}: {spent / case_count * 1e3:.1f} ms a case")
        if profiler is not None:
            pstats.Stats(profiler).sort_stats("cumulative").print_stats(30)
    finally:
        shutil.rmtree(folder)


if __name__ == "__main__":
    main()
