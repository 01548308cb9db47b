"""``compare``: how runs are named, what ends with status 1, what is refused."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from stored_rows import some_row, some_run

from shadowbench.store import Store

Command = Callable[..., Any]

CASE: dict[str, Any] = {
    "machine": "m",
    "visibility_digest": "bits",
    "counters": {"tests": 7},
    "kept": {"map": 64},
    "samples": {"build": [1.0 + 0.001 * i for i in range(10)], "shade": [2.0 + 0.001 * i for i in range(10)]},
}


def _keep(folder: Path, run_id: str, *rows: dict[str, Any]) -> None:
    with Store.open(folder) as store:
        store.start_run(some_run(run_id=run_id, created_at=f"{run_id[:4]}-01-31T12:00:00+00:00", plan_key=run_id))
        for fields in rows:
            store.add_row(some_row(**(CASE | fields | {"run_id": run_id})))


@pytest.fixture
def two_runs(tmp_path: Path) -> Path:
    """A results folder with a run and one that is slower, has other pixels, counters and bytes, and a crash."""
    folder = tmp_path / "kept"
    _keep(folder, "2025-first", {"method": "pcf"}, {"method": "esm"}, {"method": "gone"}, {"method": "vsm"})
    slower = {name: [1.5 * sample for sample in samples] for name, samples in CASE["samples"].items()}
    changed = {"samples": slower, "visibility_digest": "others", "counters": {"tests": 8}, "kept": {"map": 65}}
    crash = {"outcome": "crash", "reason": "SIGSEGV"}
    _keep(folder, "2026-second", {"method": "pcf"}, {"method": "esm"} | changed, {"method": "vsm"} | crash)
    return folder


def test_runs_are_named_as_everywhere_and_in_other_folders(command: Command, two_runs: Path, tmp_path: Path) -> None:
    in_folder = command("compare", "2025", "latest", "--results", str(two_runs))
    assert in_folder.status == 0, in_folder.err
    assert "same in everything, no difference in time shown" in in_folder.out
    assert "failed in B: crash: SIGSEGV" in in_folder.out
    assert "only in A" in in_folder.out
    elsewhere = command("compare", f"{two_runs}:2025-first", f"{two_runs}:latest", "--results", str(tmp_path / "none"))
    assert (elsewhere.status, elsewhere.out) == (0, in_folder.out)
    backwards = command("compare", "latest", "2025", "--results", str(two_runs))
    assert "only in B" in backwards.out
    assert "failed in A: crash: SIGSEGV" in backwards.out


@pytest.mark.parametrize("kind", ["slower", "pixels", "counters", "memory", "failures", "missing"])
def test_each_kind_of_change_may_end_with_status_1(command: Command, two_runs: Path, kind: str) -> None:
    ended = command("compare", "2025", "2026", "--results", str(two_runs), "--fail-on", kind)
    assert ended.status == 1
    assert f"{kind}: 1 of 4 cases" in ended.err
    backwards = command("compare", "2026", "2025", "--results", str(two_runs), "--fail-on", kind)
    assert backwards.status == (1 if kind in ("pixels", "counters", "memory") else 0)
    same = command("compare", "2025", "2025", "--results", str(two_runs), "--fail-on", kind)
    assert same.status == 0


def test_several_kinds_may_be_given_at_once_or_one_by_one(command: Command, two_runs: Path) -> None:
    options = ["--results", str(two_runs), "--fail-on", "slower, pixels", "--fail-on", "failures"]
    ended = command("compare", "2025", "2026", *options)
    assert [line.split()[1] for line in ended.err.splitlines()] == ["slower:", "pixels:", "failures:"]


def test_what_is_within_the_threshold_is_not_slower(command: Command, two_runs: Path) -> None:
    options = ["--results", str(two_runs), "--fail-on", "slower"]
    assert command("compare", "2025", "2026", *options, "--threshold", "60").status == 0
    assert command("compare", "2025", "2026", *options, "--threshold", "0").status == 1


def test_asking_for_times_that_cannot_be_compared_is_told(command: Command, two_runs: Path) -> None:
    _keep(two_runs, "2027-elsewhere", {"method": "pcf", "machine": "another"})
    ended = command("compare", "2025", "2027", "--results", str(two_runs), "--fail-on", "slower")
    assert ended.status == 0
    assert "warning: some times were not compared: measured on another machine" in ended.err


@pytest.mark.parametrize("form", ["rich", "markdown", "csv", "json"])
def test_every_format_prints_and_writes(command: Command, two_runs: Path, tmp_path: Path, form: str) -> None:
    given = ("compare", "2025", "2026", "--results", str(two_runs), "--format", form)
    printed, written = command(*given), command(*given, "-o", "comparison.txt")
    assert (printed.status, written.status, written.out) == (0, 0, "")
    assert (tmp_path / "comparison.txt").read_text(encoding="utf-8").split() == printed.out.split()
    if form == "json":
        assert len(json.loads(printed.out)["cases"]) == 4


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["2025", "3000"], "no run in .* is called '3000'"),
        (["2025", "nowhere:latest"], "nowhere: holds no results"),
        (["2025", "2026", "--fail-on", "slow"], "--fail-on knows no 'slow'; did you mean 'slower'"),
        (["2025", "2026", "--threshold", "-1"], "--threshold must be a percentage"),
        (["2025", "2026", "--threshold", "nan"], "--threshold must be a percentage"),
        (["2025", "2026", "--format", "latex"], "no format of comparisons is called 'latex'"),
        (["2025", "2027"], "have no case in common"),
    ],
)
def test_wrong_usage_is_one_line_and_status_2(
    command: Command, two_runs: Path, arguments: list[str], message: str
) -> None:
    _keep(two_runs, "2027-other", {"method": "another"})
    ended = command("compare", *arguments, "--results", str(two_runs))
    assert ended.status == 2
    assert ended.err.startswith("shadowbench: error: ")
    assert re.search(message, ended.err)
    assert ended.err.count("\n") == 1
    assert ended.out == ""
