"""From an experiment to result rows: planning, worker processes, interleaved rounds, outcomes.

::

    cases.py        RunOptions, Case, Plan, Observer: plain values     parent process
    planning.py     experiments -> plan                                parent
    running.py      plan -> rows in the store                          parent
    bench.py        what every part of a run needs                     parent
    comparison.py   one comparison: prepare once, measure in blocks    parent
    block.py        cases parked side by side, timed in rounds         parent
    members.py      what is timed in a block, and what it gave         parent
    rounds.py       balanced order, fresh processes, stop rule         parent
    finishing.py    timed cases -> rows: quality measured, or known    parent
    row_making.py   what was found -> result row                       parent
    finished.py     which cases have their row already                 parent
    cluster/        comparisons handed to other machines               parent
    pool.py         worker processes: start, ask, watch, kill          parent
    protocol.py     what the two sides say to each other               both
    cache.py        memory-mapped worlds, receivers, references        both
    worker.py       the worker's loop                                  worker
    resolving.py    names and parameters -> descriptions               worker
    preparation.py  scenes, receivers and references                   worker
    kernels.py      compiling kernels beforehand                       worker
    case_host.py    one case: load, warm up, rounds, measures          worker
    sampling.py     repeats of short frames, warming up                worker
    camera_host.py  the camera pass, timed in the same rounds          worker
    peak_memory.py  largest resident size, case by case                worker

The parent process never imports Warp, a plugin or a scene: whatever they do, it lives on and keeps the rows. Names are
imported from here at first use, since every worker starts by importing this package.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from shadowbench.runner.cases import Case, Observer, Plan, RunOptions, SilentObserver, View
    from shadowbench.runner.planning import plan
    from shadowbench.runner.running import run

__all__ = ["Case", "Observer", "Plan", "RunOptions", "SilentObserver", "View", "plan", "run"]

_HOME = {"plan": "planning", "run": "running"}


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"module {__name__} has no attribute {name}")
    return getattr(import_module(f"{__name__}.{_HOME.get(name, 'cases')}"), name)
