"""One comparison: what its cases share is prepared once, then they are measured in one block or several.

Where the cases do not fit in memory side by side, or some have their row from before, each further block times the
comparison's first case again: rows of different blocks can then be compared by their ratio to it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from shadowbench.identity import available_cores
from shadowbench.rows import Outcome
from shadowbench.runner.bench import OWN_WORK_TIMEOUT_S, Bench
from shadowbench.runner.block import MOST_PARKED, Block
from shadowbench.runner.cases import Case, Obstacle
from shadowbench.runner.finishing import prepare_view
from shadowbench.runner.protocol import CaseFailure

LEAST_LOADING_BUDGET_S = 12.0
"""For loading a comparison's cases again in fresh processes, however short its budget for rounds."""


def measure_comparison(bench: Bench, cases: Sequence[Case], baseline: Case | None, budget_s: float) -> None:
    """Give each case its row.

    Args:
        bench: The run's tools.
        cases: Those of one comparison that have no row yet.
        baseline: The comparison's first case that can be measured, whether it has a row or not.
        budget_s: For the rounds of each block [s]; the same once more for loading cases again, all blocks together.
    """
    waiting = []
    for case in cases:
        if case.obstacle is None:
            waiting.append(case)
        else:
            bench.end(case, case.obstacle)
    if not waiting:
        return
    _compile_kernels(bench, waiting)
    known = bench.known(waiting)
    try:
        entries = prepare_view(bench, waiting[0], with_reference=any(c.quality_key not in known for c in waiting))
    except CaseFailure as failure:
        obstacle = Obstacle(Outcome.ERROR, f"{waiting[0].view}: {failure.reason}", failure.stderr_tail)
        for case in waiting:
            bench.end(case, obstacle)
        return
    loading_budget_s = max(budget_s, LEAST_LOADING_BUDGET_S) / math.ceil(len(waiting) / MOST_PARKED)
    while waiting:
        block = Block(bench, entries, waiting[0], known)
        if baseline is not None and baseline not in waiting and baseline.case_key not in bench.failed:
            block.load(baseline, is_repeat=True)
        while waiting and block.has_room():
            case = waiting.pop(0)
            if waiting:
                bench.pool.warm(case.threads, 2)  # the next worker starts while this one loads
            block.load(case)
        block.time(budget_s, loading_budget_s)
        block.finish()


def _compile_kernels(bench: Bench, cases: Sequence[Case]) -> None:
    """Have the kernels of all methods compiled side by side; a worker that knows them takes no time over it."""
    bench.observer.case_started(cases[0], "compile")
    worker = bench.pool.take(available_cores())
    arguments = {"methods": sorted({case.method for case in cases}), "device": cases[0].device}
    try:
        found = worker.ask("compile_kernels", arguments, OWN_WORK_TIMEOUT_S)
    except CaseFailure:
        worker.kill()  # the case whose kernels cannot be compiled will say so itself
    else:
        bench.kernel_ms = found | bench.kernel_ms
        bench.park(worker)
