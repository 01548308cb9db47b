"""``run``: what is asked for, what is printed where, and the exit status. The runner is a fake, but in one test."""

from __future__ import annotations

import io
import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import pytest
from rich.console import Console
from stored_rows import some_row, some_run

from shadowbench.cli.progress import CaseLabels, Described, LiveProgress
from shadowbench.cli.run import experiments_of
from shadowbench.errors import StoreError, UsageError
from shadowbench.experiment import Experiment
from shadowbench.rows import Outcome, ResultRow, RunRecord, RunStatus
from shadowbench.runner import Case, Observer, Plan, RunOptions, View
from shadowbench.store import Store

Command = Callable[..., Any]

NO_CHOICES: dict[str, Any] = dict.fromkeys(
    ("methods", "scenes", "lights", "cameras", "sizes", "pixel_samples", "layers", "moving", "threads"), ()
)
VIEW = View("box-on-plane", {"height": 0.5}, "", "", 12, "sun", "main", 64, 48)


def case(method: str = "pcf", **parameters: Any) -> Case:
    return Case("quick", 0, VIEW, method, method, parameters, True, "cpu", 2, "", method + str(parameters))


class FakeRunner:
    """Plans one case per row, and keeps the rows instead of measuring."""

    def __init__(self) -> None:
        self.rows: list[ResultRow] = []
        self.earlier: list[ResultRow] = []
        self.status = RunStatus.COMPLETE
        self.asked: list[Experiment] = []
        self.options = RunOptions()

    def plan(self, experiments: Sequence[Experiment], options: RunOptions) -> Plan:
        self.asked, self.options = list(experiments), options
        print("a plugin's chatter")
        cases = tuple(case(row.method, **row.method_parameters) for row in [*self.earlier, *self.rows])
        return Plan(tuple(experiments), options, (cases,), "key", notes=("2 threads share 1 core",))

    def run(self, plan: Plan, store: Store, observer: Observer) -> RunRecord:
        names = [experiment.name for experiment in plan.experiments]
        record = some_run(experiments=names, case_count=len(plan.cases), status=self.status)
        store.start_run(record)
        for row in self.earlier:
            store.add_row(row)
        observer.planned(plan, len(self.rows))
        for row in self.rows:
            observer.case_started(case(row.method), "round 1")
            store.add_row(row)
            observer.row_finished(row)
        observer.note("something about the run")
        return record


@pytest.fixture
def runner(monkeypatch: pytest.MonkeyPatch) -> FakeRunner:
    fake = FakeRunner()
    fake.rows = [some_row("pcf"), some_row("embree", outcome="skipped", reason="not installed")]
    monkeypatch.setattr("shadowbench.runner.plan", fake.plan)
    monkeypatch.setattr("shadowbench.runner.run", fake.run)
    return fake


def test_nothing_asked_for_is_the_quick_experiment(command: Command, runner: FakeRunner) -> None:
    ended = command("run")
    assert ended.status == 0
    assert [experiment.name for experiment in runner.asked] == ["quick"]


def test_tables_go_to_standard_output_and_the_rest_to_standard_error(command: Command, runner: FakeRunner) -> None:
    ended = command("run")
    assert "1.50" in ended.out
    assert "report:" not in ended.out
    for line in ("[1/2] ok pcf", "[2/2] skipped embree", "not installed", "1 ok, 1 skipped", "note: something about"):
        assert line in ended.err
    report = Path(ended.err.rpartition("report: ")[2].strip())
    assert report.read_text(encoding="utf-8").startswith("<!DOCTYPE html>")


def test_options_reach_the_runner(command: Command, runner: FakeRunner) -> None:
    command(
        *("run", "--timeout", "5", "--budget", "2.5", "--memory-limit", "0.5", "--device", "cuda:0", "--fresh"),
        *("--plugin", "a.py", "--plugin", "b.py", "--results", "elsewhere"),
    )
    options = runner.options
    assert (options.timeout_s, options.budget_s, options.memory_limit_bytes) == (5.0, 2.5, 2**29)
    assert (options.device, options.fresh, options.results) == ("cuda:0", True, Path("elsewhere"))
    assert options.plugin_files == (Path("a.py"), Path("b.py"))
    assert options.argv[:3] == ("shadowbench", "run", "--timeout")


@pytest.mark.parametrize("outcome", list(Outcome))
def test_exit_status_says_whether_a_case_failed(command: Command, runner: FakeRunner, outcome: Outcome) -> None:
    runner.rows.append(some_row("other", outcome=outcome, reason="why"))
    ended = command("run")
    assert ended.status == (0 if outcome in (Outcome.OK, Outcome.SKIPPED) else 1)
    assert f"{outcome.value} other on box-on-plane" in ended.err  # its reason follows


def test_interrupted_run_prints_what_is_finished_and_ends_with_130(command: Command, runner: FakeRunner) -> None:
    runner.status = RunStatus.INTERRUPTED
    ended = command("run")
    assert ended.status == 130
    assert "pcf" in ended.out


def test_json_puts_only_rows_on_standard_output(command: Command, runner: FakeRunner) -> None:
    ended = command("run", "--json")
    rows = [ResultRow.model_validate(json.loads(line)) for line in ended.out.splitlines()]
    assert rows == runner.rows
    assert "chatter" in ended.err


def test_json_of_a_continued_run_holds_its_earlier_rows_once(command: Command, runner: FakeRunner) -> None:
    runner.earlier = [some_row("ray-traced")]
    methods = [json.loads(line)["method"] for line in command("run", "--json").out.splitlines()]
    assert methods == ["pcf", "embree", "ray-traced"]


def test_dry_run_prints_the_cases_and_measures_nothing(command: Command, runner: FakeRunner, tmp_path: Path) -> None:
    ended = command("run", "--dry-run")
    assert ended.status == 0
    assert "pcf(resolution=512)" in ended.out
    assert "box-on-plane" in ended.out
    assert "2 cases; nothing was measured" in ended.out
    assert not (tmp_path / "shadowbench-results").exists()


def test_dry_run_as_json_is_one_case_a_line(command: Command, runner: FakeRunner) -> None:
    planned = [json.loads(line) for line in command("run", "--dry-run", "--json").out.splitlines()]
    assert [line["method"] for line in planned] == ["pcf", "embree"]
    assert planned[0]["view"]["scene"] == "box-on-plane"


def test_report_that_cannot_be_written_is_a_warning(
    command: Command, runner: FakeRunner, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*arguments: object) -> Path:
        raise StoreError("no room")

    monkeypatch.setattr("shadowbench.report.write", fail)
    ended = command("run")
    assert ended.status == 0
    assert "shadowbench: warning: no room" in ended.err


def test_method_alone_runs_on_the_default_scene() -> None:
    (experiment,) = experiments_of([], NO_CHOICES | {"methods": ["pcf:kernel=3/5"]})
    assert experiment.name == "ad-hoc"
    assert [str(method) for method in experiment.comparisons[0].methods] == ["pcf:kernel=3/5"]


def test_options_replace_what_an_experiment_says() -> None:
    (experiment,) = experiments_of(["quick"], NO_CHOICES | {"methods": ["pcf"], "sizes": ["320x240"]})
    assert experiment.name == "quick"
    assert {str(method) for c in experiment.comparisons for method in c.methods} == {"pcf"}
    assert {size for c in experiment.comparisons for size in c.sizes} == {(320, 240)}


def test_size_alone_belongs_to_the_quick_experiment() -> None:
    (experiment,) = experiments_of([], NO_CHOICES | {"sizes": ["320x240"]})
    assert experiment.name == "quick"


def test_wrong_option_text_is_a_usage_error() -> None:
    with pytest.raises(UsageError, match="1024x768"):
        experiments_of([], NO_CHOICES | {"scenes": ["bunny"], "sizes": ["large"]})


def test_labels_name_only_parameters_that_vary() -> None:
    cases = [case(kernel=3, resolution=512), case(kernel=5, resolution=512), case("esm", kernel=7)]
    described = [Described.of_case(planned) for planned in cases]
    labels = CaseLabels(described)
    assert [labels.of(one) for one in described] == [
        *("pcf(kernel=3) on box-on-plane", "pcf(kernel=5) on box-on-plane", "esm on box-on-plane")
    ]


def test_labels_name_settings_that_vary() -> None:
    described = [Described.of_row(some_row("pcf", light=light)) for light in ("sun", "lamp")]
    labels = CaseLabels(described)
    assert [labels.of(one) for one in described] == [
        *("pcf on box-on-plane, light sun", "pcf on box-on-plane, light lamp")
    ]


def test_terminal_shows_the_case_and_its_phase() -> None:
    from rich.progress import Progress

    console = Console(file=io.StringIO(), force_terminal=True, width=100)
    progress = Progress(console=console)
    live = LiveProgress(progress)
    live.planned(Plan((), RunOptions(), ((case(),),), ""), 1)
    live.case_started(case(), "warm up")
    assert progress.tasks[0].description == "pcf on box-on-plane: warm up"
    live.row_finished(some_row("pcf"))
    assert progress.tasks[0].finished


@pytest.mark.slow
def test_real_run_leaves_rows_tables_and_a_report(command: Command) -> None:
    options = ("-s", "box-on-plane", "-m", "shadow-map:resolution=64/128", "--size", "64x48", "--threads", "1")
    ended = command("run", *options, "--budget", "1", "--json")
    rows = [json.loads(line) for line in ended.out.splitlines()]
    assert ended.status == 0, ended.err
    assert [row["outcome"] for row in rows] == ["ok", "ok"]
    page = Path(ended.err.rpartition("report: ")[2].strip()).read_text(encoding="utf-8")
    assert page.count("data:image/webp") == 5
    again = command("run", *options, "--budget", "1")
    assert again.status == 0
    assert "has a row for every case already" in again.err
