"""``claims`` and ``pareto``."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from stored_rows import some_row, some_run

from shadowbench.cli.run import _print_claims
from shadowbench.store import Store

Command = Callable[..., Any]

FILE = """\
title = "Quick"
[[comparison]]
scene = "bunny"
[[claim]]
name = "few-failures"
statement = "Few receivers fail."
test = {value = "failure_percent", of = {method = "pcf"}, is = "at most", number = LIMIT}
"""

TEST = {"value": "failure_percent", "relation": "at most", "of": {"method": "pcf"}, "number": 2.0}


@pytest.fixture
def claimed(tmp_path: Path) -> Path:
    """A results folder with a run whose one claim holds."""
    folder = tmp_path / "claimed"
    claim = {"name": "few-failures", "statement": "Few receivers fail.", "source": "", "tests": [TEST]}
    definition = {"name": "quick", "source": "Somebody", "case_count": 1, "claims": [claim]}
    with Store.open(folder) as store:
        store.start_run(some_run(case_count=1, definitions=[definition]))
        store.add_row(some_row("pcf"))
    return folder


def test_claims_are_answered_with_their_evidence(command: Command, claimed: Path) -> None:
    ended = command("claims", "latest", "--results", str(claimed))
    assert ended.status == 0
    assert "holds" in ended.out
    assert "Few receivers fail." in ended.out
    assert "1.25 % against 2.00 %" in ended.out
    (answer,) = json.loads(command("claims", "latest", "--results", str(claimed), "-f", "json").out)
    assert (answer["verdict"], answer["source"]) == ("holds", "Somebody")


@pytest.mark.parametrize(
    ("limit", "fail_on", "status"),
    [
        ("2.0", "undecided", 0),
        ("1.0", None, 0),
        ("1.0", "does-not-hold", 1),
        ("1.0", "undecided", 1),
    ],
)
def test_the_exit_status_says_what_it_is_asked_to(
    command: Command, claimed: Path, tmp_path: Path, limit: str, fail_on: str | None, status: int
) -> None:
    (tmp_path / "quick.toml").write_text(FILE.replace("LIMIT", limit), encoding="utf-8")
    options = ["--claims-of", "quick.toml", *(["--fail-on", fail_on] if fail_on else [])]
    assert command("claims", "latest", "--results", str(claimed), *options).status == status


def test_an_open_claim_fails_only_if_asked_to(command: Command, claimed: Path, tmp_path: Path) -> None:
    text = FILE.replace("LIMIT", "2.0").replace('method = "pcf"', 'method = "vsm"')
    (tmp_path / "quick.toml").write_text(text, encoding="utf-8")
    arguments = ("claims", "latest", "--results", str(claimed), "--claims-of", "quick.toml", "--fail-on")
    ended = command(*arguments, "does-not-hold")
    assert ended.status == 0
    assert "no case has method vsm" in ended.out
    assert command(*arguments, "undecided").status == 1


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--format", "latx"], "did you mean 'latex'"),
        (["--experiment", "quik"], "did you mean 'quick'"),
        (["--fail-on", "undecide"], "did you mean 'undecided'"),
        (["--claims-of", "tour"], "the run has no experiment 'tour'"),
        (["--output", "no/such/folder"], "--output no/such/folder: No such file"),
    ],
)
def test_wrong_option_of_claims_is_refused(command: Command, claimed: Path, options: list[str], message: str) -> None:
    ended = command("claims", "latest", "--results", str(claimed), *options)
    assert ended.status == 2
    assert message in ended.err
    assert ended.out == ""


def test_a_run_ends_with_how_many_claims_hold(claimed: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with Store.open(claimed) as store:
        record = store.find_run("latest")
        rows = store.rows(record.run_id)
    _print_claims(rows, record)
    assert capsys.readouterr().err == f"claims: 1 holds (shadowbench claims {record.run_id})\n"
    _print_claims(rows, record.model_copy(update={"definitions": []}))
    assert capsys.readouterr().err == "", "where nothing is claimed there is nothing to say"


def test_a_run_without_claims_says_so(command: Command, results: Path) -> None:
    ended = command("claims", "latest", "--results", str(results))
    assert ended.status == 0
    assert "made a claim" in ended.err
    assert "--claims-of NAME" in ended.err
    assert command("claims", "latest", "--results", str(results), "--claims-of", "papers").status == 0


def test_fronts_and_limits_are_printed_and_written(command: Command, claimed: Path, tmp_path: Path) -> None:
    ended = command("pareto", "latest", "--results", str(claimed))
    assert ended.status == 0
    assert "front" in ended.out
    csv_text = command("pareto", "latest", "--results", str(claimed), "-f", "csv").out
    assert csv_text.startswith(
        "scene,light,camera,size,method,dynamic_frame_ms,failure_percent,standing,dominated_by\n"
    )
    limits = ("--within-ms", "3.05", "--within-mb", "1", "--within-percent", "2")
    written = command("pareto", "latest", "--results", str(claimed), *limits, "-f", "json", "-o", "best.json")
    assert (written.status, written.out) == (0, "")
    made = json.loads((tmp_path / "best.json").read_text(encoding="utf-8"))
    within_time, within_memory, within_failures = made
    assert within_time["body"][0][4]["value"] == "none", "its interval reaches beyond"
    assert within_memory["body"] == [], "no row holds its bytes"
    assert within_failures["body"][0][4]["value"] == "pcf"


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--cost", "shade_m"], "did you mean 'shade_ms'"),
        (["--quality", "ssim"], "less must be better"),
        (["--experiment", "quik"], "did you mean 'quick'"),
        (["--within-ms", "-1"], "--within-ms"),
    ],
)
def test_wrong_option_of_pareto_is_refused(command: Command, claimed: Path, options: list[str], message: str) -> None:
    ended = command("pareto", "latest", "--results", str(claimed), *options)
    assert ended.status == 2
    assert message in ended.err


@pytest.mark.parametrize("name", ["claims", "pareto", "table"])
def test_reading_a_run_imports_neither_warp_nor_a_plugin(claimed: Path, name: str) -> None:
    code = (
        f"import sys; from shadowbench.cli import main; main(['{name}', 'latest', '--results', sys.argv[1]]); "
        "print('MODULES', *sorted(sys.modules))"
    )
    ended = subprocess.run([sys.executable, "-c", code, str(claimed)], capture_output=True, text=True, check=True)
    loaded = set(ended.stdout.rpartition("MODULES")[2].split())
    assert not {m for m in loaded if m.split(".")[0] in ("warp", "pyvista", "pandas", "plotly")}
    assert not {m for m in loaded if m.startswith(("shadowbench.methods", "shadowbench.scenes", "shadowbench.device"))}
