"""Runs of plugins that misbehave, on a scene small enough to be measured at once."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from shadowbench import experiment, runner
from shadowbench.rows import ResultRow, RunRecord
from shadowbench.runner import Case, Plan, RunOptions
from shadowbench.store import Store

PLUGINS = Path(__file__).parent / "plugins"
PLUGIN_FILES = (PLUGINS / "tiny_scene.py", PLUGINS / "misbehaving.py")


@dataclass
class Recorder:
    """An observer that remembers, and may raise something when the n-th row is finished."""

    raise_at_row: int | None = None
    error: type[BaseException] = KeyboardInterrupt
    remaining: int | None = None
    phases: list[tuple[str, str]] = field(default_factory=list)
    rows: list[ResultRow] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    def planned(self, plan: Plan, remaining: int) -> None:
        self.remaining = remaining

    def case_started(self, case: Case, phase: str) -> None:
        self.phases.append((case.method, phase))

    def row_finished(self, row: ResultRow) -> None:
        self.rows.append(row)
        if len(self.rows) == self.raise_at_row:
            raise self.error

    def note(self, text: str) -> None:
        self.notes.append(text)


@dataclass
class Ended:
    """A run that ended, and all that the store has of it."""

    record: RunRecord
    rows: list[ResultRow]
    seen: Recorder

    def row(self, method: str) -> ResultRow:
        (found,) = (row for row in self.rows if row.method == method)
        return found


def options(results: Path, **changes: Any) -> RunOptions:
    """Options for small runs: few rounds, little time, one process a case."""
    rounds = {"min_rounds": 2, "max_rounds": 3, "processes": 1}
    given = {"threads": (1,), "budget_s": 5.0, "plugin_files": PLUGIN_FILES} | rounds
    return RunOptions(results=results, **(given | changes))  # type: ignore[arg-type]


def planned(results: Path, *methods: str, scenes: tuple[str, ...] = ("tiny",), **changes: Any) -> Plan:
    """Plan methods on the tiny scene."""
    chosen = experiment.from_options(
        methods=methods,
        scenes=scenes,
        sizes=changes.pop("sizes", ["48x32"]),
        **{name: changes.pop(name, []) for name in ("lights", "pixel_samples", "layers", "moving")},
    )
    return runner.plan([chosen], options(results, **changes))


def carry_out(plan: Plan, observer: Recorder | None = None) -> Ended:
    """Run a plan and read back what was kept."""
    seen = Recorder() if observer is None else observer
    with Store.open(plan.options.results) as store:
        record = runner.run(plan, store, seen)
        return Ended(record, store.rows(record.run_id), seen)


def kept(results: Path) -> Ended:
    """Read back the last run of a folder, which another process may have carried out."""
    with Store.open(results, create=False) as store:
        record = max(store.runs(), key=lambda run: run.created_at)
        return Ended(record, store.rows(record.run_id), Recorder())
