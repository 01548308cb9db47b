"""The same method under two names, and with three in a hundred more arithmetic: what the instrument says of each.

    python tests/benchmarks/same_and_slower.py [--comparisons 20] [--rounds 120] [--processes 8] [--slower 0.03]
                                               [--load same|both|none] [--results DIR] [--keep]

Two experiments through the real runner, store and verdicts, each of as many comparisons of two cases as asked for
(told apart by a number that changes nothing):

* *same* (A/A): ``here`` against ``there``, which are the same code, while another process loads one core on and off.
  At most 2 of 20 may be declared different.
* *slower* (A/B): ``there`` does 3 % more arithmetic. At least 18 of 20 must be found, and all in the right direction.

The number of rounds and processes is fixed beforehand: every comparison takes all of them, whatever it shows meanwhile.
Each is judged alone, as in a table of its own; what a table of all of them says stands beside it.
"""

from __future__ import annotations

import argparse
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from statistics import median, stdev

from shadowbench import runner
from shadowbench.choices import Choice
from shadowbench.experiment import Comparison, Experiment
from shadowbench.rows import Outcome
from shadowbench.runner import RunOptions
from shadowbench.statistics import Verdict, judge
from shadowbench.store import Store
from shadowbench.tables.verdicts import contrast_of

PLUGINS = Path(__file__).parent.parent / "plugins"
PLUGIN_FILES = (PLUGINS / "tiny_scene.py", PLUGINS / "arithmetic.py")
SIZE = (48, 32)
STEPS = 800
"""A frame of about a millisecond; 3 % more is a multiple of 8, as far as loops are unrolled."""

TIME = "shade_ms"

_LOAD = """
import random, sys, time
rng = random.Random(int(sys.argv[1]))
while True:
    end = time.monotonic() + rng.uniform(0.2, 3.0)
    while time.monotonic() < end:
        sum(range(10000))
    time.sleep(rng.uniform(0.2, 3.0))
"""


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--comparisons", type=int, default=20)
    parser.add_argument("--rounds", type=int, default=120)
    parser.add_argument("--processes", type=int, default=8)
    parser.add_argument("--slower", type=float, default=0.03)
    parser.add_argument("--steps", type=int, default=STEPS)
    parser.add_argument("--load", choices=("same", "both", "none"), default="same")
    parser.add_argument("--results", type=Path, help="where to keep the results; a temporary folder if not given")
    arguments = parser.parse_args()
    folder = arguments.results or Path(tempfile.mkdtemp(prefix="same-and-slower-"))
    try:
        _report(arguments, folder, "same", 0.0, Verdict.NO_DIFFERENCE, load=arguments.load != "none")
        _report(arguments, folder, "slower", arguments.slower, Verdict.SLOWER, load=arguments.load == "both")
    finally:
        if arguments.results is None:
            shutil.rmtree(folder)


def _report(arguments, folder, name, slower, expected, *, load):
    begin = time.monotonic()
    loading = subprocess.Popen([sys.executable, "-c", _LOAD, "1"]) if load else None
    try:
        contrasts = _contrasts(arguments, folder, name, slower)
    finally:
        if loading is not None:
            loading.kill()
            loading.wait()
    alone = [judge([contrast])[0] for contrast in contrasts]
    together = judge(contrasts)
    print(f"{name}: {len(contrasts)} comparisons of {TIME} in {time.monotonic() - begin:.0f} s, a core loaded: {load}")
    for judgement, contrast in zip(alone, contrasts, strict=True):
        ratio = judgement.ratio
        medians = [median(group) for group in _by_process(contrast)]
        between = stdev(medians) if len(medians) > 1 else float("nan")
        print(
            f"  [{ratio.low:.4f}, {ratio.estimate:.4f}, {ratio.high:.4f}] {judgement.verdict.value}; "
            f"between processes {between:.2%}, between rounds {stdev(contrast.log_ratios):.2%}"
        )
    for way, judged in (("each alone", alone), ("as one table", together)):
        counts = {verdict: sum(j.verdict is verdict for j in judged) for verdict in Verdict}
        print(f"  {way}: " + ", ".join(f"{count} {verdict.value}" for verdict, count in counts.items()))
    found = sum(judgement.verdict is expected for judgement in alone)
    wrong = sum(j.verdict is not expected and j.verdict is not Verdict.NO_DIFFERENCE for j in alone)
    print(f"  {found} of {len(alone)} as they are; {wrong} declared what they are not", flush=True)


def _by_process(contrast):
    groups = {}
    for value, process in zip(contrast.log_ratios, contrast.processes, strict=True):
        groups.setdefault(process, []).append(value)
    return list(groups.values())


def _contrasts(arguments, folder, name, slower):
    """Run the comparisons and return what the rounds of each say of ``there`` over ``here``."""
    comparisons = []
    for number in range(1, arguments.comparisons + 1):
        amounts = {"here": arguments.steps, "there": round(arguments.steps * (1.0 + slower))}
        methods = [Choice(name, {"steps": (steps,), "number": (number,)}) for name, steps in amounts.items()]
        comparisons.append(Comparison((Choice("tiny"),), tuple(methods), sizes=(SIZE,)))
    experiment = Experiment(name, name, tuple(comparisons))
    options = RunOptions(
        results=folder,
        threads=(1,),
        budget_s=3600.0,
        min_rounds=arguments.rounds,
        max_rounds=arguments.rounds,
        processes=arguments.processes,
        plugin_files=PLUGIN_FILES,
        fresh=True,
    )
    with Store.open(folder) as store:
        record = runner.run(runner.plan([experiment], options), store)
        rows = store.rows(record.run_id)
    assert all(row.outcome is Outcome.OK for row in rows), [row.reason for row in rows]
    by_key = {row.case_key: row for row in rows}
    found = []
    for row in rows:
        if row.method == "there":
            contrast = contrast_of(row, by_key[row.baseline_case], TIME)
            assert contrast is not None
            assert len(set(contrast.processes)) == arguments.processes
            found.append(contrast)
    return found


if __name__ == "__main__":
    main()
