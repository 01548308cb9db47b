"""What a running plan shows on standard error: a live display on a terminal, plain lines elsewhere.

Both are observers of :mod:`shadowbench.runner` and print one line per finished case; :class:`JsonLines` adds the rows
themselves on standard output for ``run --json``.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TextIO

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TaskID, TextColumn, TimeElapsedColumn
from rich.text import Text

from shadowbench.cli.console import err, plain
from shadowbench.rows import Outcome, ResultRow, method_label
from shadowbench.tables.numbers import number_text
from shadowbench.tables.plain_text import shortened

if TYPE_CHECKING:
    from shadowbench.runner import Case, Observer, Plan
    from shadowbench.runner.cases import View


@contextmanager
def showing_progress(json_to: TextIO | None = None) -> Iterator[Observer]:
    """Yield the observer that suits standard error, and end its display afterwards.

    Args:
        json_to: Where rows go as JSON Lines, if they shall.
    """
    console = err()
    if not console.is_terminal:
        lines = PlainProgress(console)
        yield lines if json_to is None else JsonLines(lines, json_to)
        return
    columns = (
        TextColumn("{task.description}", markup=False),
        BarColumn(bar_width=24),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
    )
    with Progress(*columns, console=console, transient=True) as progress:
        live = LiveProgress(progress)
        yield live if json_to is None else JsonLines(live, json_to)


class PlainProgress:
    """One line per finished case, and per note."""

    def __init__(self, console: Console) -> None:
        """Write to ``console``."""
        self.console = console
        self.case_count = self.finished_count = 0
        self._labels = CaseLabels(())

    def planned(self, plan: Plan, remaining: int) -> None:
        """Say what there is to do."""
        self.case_count = len(plan.cases)
        self.finished_count = self.case_count - remaining
        self._labels = CaseLabels(map(Described.of_case, plan.cases))
        names = ", ".join(experiment.name for experiment in plan.experiments)
        done = f", {self.finished_count} of them finished already" if self.finished_count else ""
        self.say(plain(f"{names}: {_cases(self.case_count)}{done}"))
        for text in plan.notes:
            self.note(text)

    def case_started(self, case: Case, phase: str) -> None:
        """Stay quiet: a log needs no phases."""

    def row_finished(self, row: ResultRow) -> None:
        """Print the case's line."""
        self.finished_count += 1
        width = len(str(self.case_count))
        head = Text(f"[{self.finished_count:>{width}}/{self.case_count}] ", style="dim")
        label = self._labels.of(Described.of_row(row))
        self.say(head + outcome_text(row.outcome) + plain(f" {label}  ") + plain(row_figures(row), "dim"))

    def note(self, text: str) -> None:
        """Print a note."""
        self.say(plain(f"note: {text}", "yellow"))

    def say(self, line: Text) -> None:
        """Print a line."""
        self.console.print(line, soft_wrap=True)


class LiveProgress(PlainProgress):
    """The same lines above a bar that names the case being measured and its phase."""

    def __init__(self, progress: Progress) -> None:
        """Add a bar to ``progress``."""
        super().__init__(progress.console)
        self._progress = progress
        self._task: TaskID = progress.add_task("planning", total=None)

    def planned(self, plan: Plan, remaining: int) -> None:
        """Say what there is to do, and start the bar."""
        super().planned(plan, remaining)
        self._progress.update(self._task, total=self.case_count, completed=self.finished_count)

    def case_started(self, case: Case, phase: str) -> None:
        """Show the case and its phase."""
        label = self._labels.of(Described.of_case(case))
        self._progress.update(self._task, description=plain(f"{shortened(label, 60)}: {phase}").plain)

    def row_finished(self, row: ResultRow) -> None:
        """Print the case's line and advance the bar."""
        super().row_finished(row)
        self._progress.update(self._task, completed=self.finished_count)


class JsonLines:
    """Passes everything on, and writes each row as one line of JSON."""

    def __init__(self, inner: Observer, stream: TextIO) -> None:
        """Write to ``stream``; ``inner`` shows the progress."""
        self._inner = inner
        self._stream = stream
        self._written: set[tuple[str, str]] = set()

    def planned(self, plan: Plan, remaining: int) -> None:
        """Pass it on."""
        self._inner.planned(plan, remaining)

    def case_started(self, case: Case, phase: str) -> None:
        """Pass it on."""
        self._inner.case_started(case, phase)

    def row_finished(self, row: ResultRow) -> None:
        """Write the row at once."""
        self._write(row)
        self._inner.row_finished(row)

    def write_rest(self, rows: Iterable[ResultRow]) -> None:
        """Write those rows that were not written yet: of a continued run, what it had before."""
        for row in rows:
            if (row.experiment, row.case_key) not in self._written:
                self._write(row)

    def _write(self, row: ResultRow) -> None:
        self._written.add((row.experiment, row.case_key))
        self._stream.write(row.model_dump_json() + "\n")
        self._stream.flush()

    def note(self, text: str) -> None:
        """Pass it on."""
        self._inner.note(text)


def outcome_text(outcome: Outcome) -> Text:
    """Return an outcome in its colour."""
    style = "bold red" if outcome.is_failure else "green" if outcome is Outcome.OK else "yellow"
    return Text(outcome.value, style=style)


@dataclass(frozen=True)
class Described:
    """What tells a case apart, of a planned case and of its row alike."""

    method: str
    method_parameters: dict[str, Any]
    scene: str
    scene_parameters: dict[str, Any]
    settings: dict[str, str]

    @classmethod
    def of_case(cls, case: Case) -> Described:
        """Describe a planned case."""
        view = case.view
        settings = _settings(case.experiment, view, case.threads)
        return cls(case.method, case.method_parameters, view.scene, view.scene_parameters, settings)

    @classmethod
    def of_row(cls, row: ResultRow) -> Described:
        """Describe a row's case."""
        settings = _settings(row.experiment, row, row.threads)
        return cls(row.method, row.method_parameters, row.scene, row.scene_parameters, settings)

    def values(self) -> Iterator[tuple[str, str, str]]:
        """Yield (owner, name, value) of everything that may vary."""
        for owner, named in (
            (self.method, self.method_parameters),
            (self.scene, self.scene_parameters),
            ("", self.settings),
        ):
            for name, value in named.items():
                yield owner, name, repr(value)


def _settings(experiment: str, view: View | ResultRow, threads: int) -> dict[str, str]:
    return {
        "experiment": experiment,
        "light": f"light {view.light}",
        "camera": f"camera {view.camera}",
        "size": f"{view.width}x{view.height}",
        "pixel_samples": f"samples a pixel {view.pixel_samples}",
        "layers": f"layers {view.layers}",
        "moving": f"moving {view.moving}",
        "threads": f"threads {threads}",
    }


class CaseLabels:
    """``method(parameters) on scene(parameters), settings``, of each what is not the same in the whole plan."""

    def __init__(self, cases: Iterable[Described]) -> None:
        """Find out what varies."""
        self._varying: set[tuple[str, str]] = set()
        first: dict[tuple[str, str], str] = {}
        for case in cases:
            for owner, name, value in case.values():
                if first.setdefault((owner, name), value) != value:
                    self._varying.add((owner, name))

    def of(self, case: Described) -> str:
        """Return a case's label."""
        method = self._label(case.method, case.method_parameters)
        scene = self._label(case.scene, case.scene_parameters)
        return ", ".join([f"{method} on {scene}", *(v for k, v in case.settings.items() if ("", k) in self._varying)])

    def _label(self, name: str, parameters: dict[str, Any]) -> str:
        only = {parameter for owner, parameter in self._varying if owner == name}
        return shortened(method_label(name, parameters, only=only))


def row_figures(row: ResultRow) -> str:
    """Return the figures of a measured case, or why it was not."""
    if row.outcome is not Outcome.OK:
        return row.reason
    figures = []
    for name, value in (("build", row.build_ms), ("shade", row.shade_ms)):
        if value is not None:
            figures.append(f"{name} {number_text(value, 'ms')} ms")
    if row.failure_percent is not None:
        figures.append(f"failure {number_text(row.failure_percent, '%')} %")
    return ", ".join(figures)


def _cases(count: int) -> str:
    return "1 case" if count == 1 else f"{count} cases"
