"""Comparisons as text: the same facts in every format, for people and for programs, whatever the names are."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Callable
from typing import Any

import pytest
from rich.console import Console

from shadowbench.errors import UsageError
from shadowbench.rows import ResultRow, RunRecord
from shadowbench.tables.comparing import RunComparison, compare_runs
from shadowbench.tables.comparison_text import COMPARISON_FORMATS, render_comparison

MakeRow = Callable[..., ResultRow]
MakeRun = Callable[..., RunRecord]

SAMPLES = {"build": [1.0 + 0.001 * i for i in range(10)], "shade": [2.0 + 0.001 * i for i in range(10)]}


@pytest.fixture
def comparison(make_row: MakeRow, make_run: MakeRun) -> RunComparison:
    """One case that is the same, one that is slower and counts more, one that crashes."""
    given: dict[str, Any] = {"machine": "m", "visibility_digest": "bits", "counters": {"tests": 7}}
    slower = {name: [2.0 * sample for sample in samples] for name, samples in SAMPLES.items()}
    a = [make_row(method=name, light=name, samples=SAMPLES, **given) for name in ("same", "slow", "bad")]
    b = [
        make_row(method="same", light="same", samples=SAMPLES, **given),
        make_row(method="slow", light="slow", samples=slower, **(given | {"counters": {"tests": 1234567}})),
        make_row(method="bad", light="bad", outcome="crash", reason="SIGSEGV"),
    ]
    return compare_runs(make_run(), a, make_run(run_id="run-2"), b)


def _printed(comparison: RunComparison, form: str, width: int = 160) -> str:
    written = render_comparison(comparison, form)
    if isinstance(written, str):
        return written
    console = Console(file=io.StringIO(), width=width)
    console.print(written)
    assert isinstance(console.file, io.StringIO)
    return console.file.getvalue()


def test_the_terminal_shows_every_case_with_its_line_and_what_changed_by_name(comparison: RunComparison) -> None:
    text = _printed(comparison, "rich")
    for said in (
        "B run-2 against A run-1",
        "same in everything, no difference in time shown",
        "same pixels, counters changed, slower",
        "failed in B: crash: SIGSEGV",
        "tests 7 → 1,234,567",
        "2.000",
    ):
        assert said in text
    assert all(len(line) <= 60 for line in _printed(comparison, "rich", 60).splitlines())


def test_markdown_has_the_summary_first_then_what_changed_and_all_cases_folded(comparison: RunComparison) -> None:
    text = _printed(comparison, "markdown")
    summary, changed, folded = (
        text.index("3 cases, 2 changed"),
        text.index("#### What changed"),
        text.index("<details>"),
    )
    assert summary < changed < folded
    assert "same in everything" not in text[changed:folded]
    assert text[folded:].count("| bunny |") + text[folded:].count("| bunny ") >= 3
    assert text.rstrip().endswith("</details>")


def test_csv_has_a_line_a_case(comparison: RunComparison) -> None:
    lines = list(csv.DictReader(io.StringIO(_printed(comparison, "csv"))))
    assert [line["method"] for line in lines] == ["same", "slow", "bad"]
    assert [line["summary"] for line in lines] == [case.summary for case in comparison.cases]
    same, slow, bad = lines
    assert (float(same["build_ratio"]), same["build_verdict"]) == (1.0, "no difference shown")
    assert float(slow["shade_ratio"]) == pytest.approx(2.0, rel=1e-3)
    assert json.loads(slow["counters"]) == {"tests": [7, 1234567]}
    assert json.loads(slow["changed"]) == ["counters", "slower"]
    assert (bad["build_ratio"], bad["outcome_b"], bad["reason_b"]) == ("", "crash", "SIGSEGV")


def test_json_says_the_same(comparison: RunComparison) -> None:
    found = json.loads(_printed(comparison, "json"))
    assert (found["a"]["run_id"], found["b"]["run_id"]) == ("run-1", "run-2")
    assert [case["summary"] for case in found["cases"]] == [case.summary for case in comparison.cases]
    times = found["cases"][1]["times"]
    assert times["build"]["verdict"] == "slower"
    assert times["build"]["low"] < times["build"]["ratio"] < times["build"]["high"]
    assert found["cases"][2]["pixels"] is None


def test_an_unknown_format_is_refused(comparison: RunComparison) -> None:
    with pytest.raises(UsageError, match="did you mean 'markdown'"):
        render_comparison(comparison, "markdwn")


@pytest.mark.parametrize("form", COMPARISON_FORMATS)
def test_no_name_does_anything_but_be_read(hostile_rows: list[ResultRow], make_run: MakeRun, form: str) -> None:
    others = [row.model_copy(update={"visibility_digest": "x", "counters": {"n": 1}}) for row in hostile_rows]
    run = make_run(code_version=hostile_rows[0].scene, machine=hostile_rows[0].scene)
    text = _printed(compare_runs(run, hostile_rows, make_run(), others), form)
    assert all(character.isprintable() or character == "\n" for character in text)
    if form == "json":
        assert next(case["scene"] for case in json.loads(text)["cases"]) == hostile_rows[0].scene
    elif form == "csv":
        lines = list(csv.reader(io.StringIO(text)))
        assert {len(line) for line in lines} == {len(lines[0])}
        assert not [cell for line in lines for cell in line if cell.lstrip().startswith(("=", "+", "@"))]
    elif form == "markdown":
        assert "<script" not in text
        assert text.count("<details>") == 1
