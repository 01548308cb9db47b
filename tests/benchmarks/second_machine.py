"""What a second machine saves that is given the first one's results: the same cases with and without them.

    python tests/benchmarks/second_machine.py [--repeats 3] [--size 640x480] [--scene bunny]

Measures once, then alternately in an empty folder and in one that holds a copy of the first results (database and
pictures, not the cache of scenes and references). This process then calls itself another machine, so that no case is
finished already. Both have few rounds, since rounds are the same work on both sides; printed are the times of
planning and running by repeat, the median of their ratios, and whether the rows agree.
"""

import argparse
import shutil
import statistics
import tempfile
import time
from pathlib import Path

from shadowbench import experiment, runner
from shadowbench.rows import ResultRow
from shadowbench.runner import planning, running
from shadowbench.runner.reuse import QUALITY_COLUMNS
from shadowbench.store import Store

METHODS = ("shadow-map", "pcf:kernel=5", "vsm", "csm", "esm")


def run(folder: Path, scene: str, size: str) -> tuple[float, list[ResultRow]]:
    """Return how long planning and running took [s], and the rows."""
    begin = time.perf_counter()
    asked = experiment.from_options(scenes=[scene], methods=list(METHODS), sizes=[size])
    plan = runner.plan([asked], runner.RunOptions(results=folder, min_rounds=6, max_rounds=6, processes=1))
    with Store.open(folder) as store:
        record = runner.run(plan, store)
        return time.perf_counter() - begin, store.rows(record.run_id)


def copied(first: Path, folder: Path) -> Path:
    """Copy what would be carried to another machine."""
    with Store.open(first) as store:  # closes the write-ahead log into the database
        store.runs()
    folder.mkdir()
    shutil.copy(first / "results.sqlite", folder)
    shutil.copytree(first / "artifacts", folder / "artifacts")
    return folder


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--size", default="640x480")
    parser.add_argument("--scene", default="bunny")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        base, ratios = Path(name), []
        first_s, rows = run(base / "first", arguments.scene, arguments.size)
        print(f"{len(rows)} cases, {arguments.scene} {arguments.size}; the first machine took {first_s:.1f} s")
        planning.machine = running.machine = lambda: "another machine"
        for repeat in range(arguments.repeats):
            without_s, alone = run(base / f"without-{repeat}", arguments.scene, arguments.size)
            with_s, given = run(copied(base / "first", base / f"with-{repeat}"), arguments.scene, arguments.size)
            assert all(row.quality_run for row in given), "quality was measured anew"
            for a, b in zip(alone, given, strict=True):
                assert all(getattr(a, column) == getattr(b, column) for column in QUALITY_COLUMNS), a.method
                assert (a.counters, a.artifacts) == (b.counters, b.artifacts), a.method
            ratios.append(with_s / without_s)
            print(f"without results {without_s:6.1f} s, with them {with_s:6.1f} s: {ratios[-1]:.2f}", flush=True)
    print(f"median ratio {statistics.median(ratios):.2f}; measures, counters and pictures are the same")


if __name__ == "__main__":
    main()
