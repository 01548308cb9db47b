"""``table`` and ``report``."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from shadowbench.tables import FORMATS

Command = Callable[..., Any]


@pytest.mark.parametrize("selector", ["latest", "20260131-120000-abcd", "2026"])
def test_run_is_found_by_id_prefix_and_latest(command: Command, results: Path, selector: str) -> None:
    ended = command("table", selector, "--results", str(results))
    assert ended.status == 0
    assert "pcf" in ended.out
    assert "skipped" in ended.out


def test_ambiguous_prefix_is_refused(command: Command, results: Path) -> None:
    ended = command("table", "20", "--results", str(results))
    assert ended.status == 2
    assert "2 runs" in ended.err


@pytest.mark.parametrize("form", FORMATS)
def test_every_format_prints_and_writes(command: Command, results: Path, tmp_path: Path, form: str) -> None:
    printed = command("table", "latest", "--results", str(results), "--format", form)
    written = command("table", "latest", "--results", str(results), "--format", form, "-o", "table.txt")
    assert (printed.status, written.status, written.out) == (0, 0, "")
    assert (tmp_path / "table.txt").read_text(encoding="utf-8").split() == printed.out.split()
    if form == "json":
        json.loads(printed.out)
    if form == "csv":
        assert [line["method"] for line in csv.DictReader(printed.out.splitlines())] == ["pcf", "embree"]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--format", "latx"], "did you mean 'latex'"),
        (["--experiment", "quik"], "did you mean 'quick'"),
        (["--output", "no/such/folder"], "--output no/such/folder: No such file"),
    ],
)
def test_wrong_option_is_refused(command: Command, results: Path, options: list[str], message: str) -> None:
    ended = command("table", "latest", "--results", str(results), *options)
    assert ended.status == 2
    assert message in ended.err
    assert ended.out == ""


def test_results_folder_may_come_from_the_environment(
    command: Command, results: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SHADOWBENCH_RESULTS", str(results))
    assert command("table", "latest").status == 0


def test_run_without_rows_says_so(command: Command, results: Path) -> None:
    ended = command("table", "2025", "--results", str(results))
    assert ended.status == 0
    assert "no finished case" in ended.err


def test_report_is_written_beside_the_run_and_its_path_printed(command: Command, results: Path) -> None:
    ended = command("report", "latest", "--results", str(results))
    path = Path(ended.out.strip())
    assert path == results / "reports" / "20260131-120000-abcd.html"
    assert path.read_text(encoding="utf-8").startswith("<!DOCTYPE html>")


def test_report_goes_where_it_is_asked_to(command: Command, results: Path, tmp_path: Path) -> None:
    assert command("report", "latest", "--results", str(results), "-o", "mine.html").out == "mine.html\n"
    assert (tmp_path / "mine.html").exists()


def test_figures_for_papers_are_written_instead_of_a_report(command: Command, results: Path, tmp_path: Path) -> None:
    ended = command("report", "latest", "--results", str(results), "--figures", "figures")
    assert ended.status == 0
    written = [Path(line) for line in ended.out.splitlines()]
    assert written
    assert {path.suffix for path in written} == {".pdf", ".svg"}
    assert all((tmp_path / path).is_file() for path in written)
    assert not (results / "reports").exists()


def test_figures_and_a_report_are_asked_for_one_at_a_time(command: Command, results: Path) -> None:
    ended = command("report", "latest", "--results", str(results), "--figures", "figures", "-o", "mine.html")
    assert ended.status == 2
    assert "leave out --output" in ended.err
