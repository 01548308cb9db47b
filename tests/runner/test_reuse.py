"""Quality is taken over from earlier rows and checked; times are always measured here."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from small_runs import Ended, carry_out, planned
from stored_rows import some_row

from shadowbench.rows import Outcome, ResultRow
from shadowbench.runner import planning, running
from shadowbench.runner.pool import Worker
from shadowbench.runner.reuse import QUALITY_COLUMNS, difference
from shadowbench.store import Store

pytestmark = pytest.mark.usefixtures("lasting_workers")

SEEN = {"counters": {"tests": 7}, "kept": {"map": 64}, "visibility_digest": "bits"}


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """What workers are asked for, in order."""
    begin, calls = Worker.begin, list[str]()

    def begin_and_tell(worker: Worker, call: str, arguments: dict[str, Any]) -> None:
        calls.append(call + (" with reference" if arguments.get("with_reference") else ""))
        begin(worker, call, arguments)

    monkeypatch.setattr(Worker, "begin", begin_and_tell)
    return calls


@pytest.fixture
def elsewhere(monkeypatch: pytest.MonkeyPatch) -> Callable[[], None]:
    """Return a function after which this is another machine."""

    def move() -> None:
        for module in (planning, running):
            monkeypatch.setattr(module, "machine", lambda: "another machine")

    return move


def _tamper(folder: Path, run_id: str, **changes: Any) -> None:
    """Change a run's rows."""
    with Store.open(folder) as store:
        for row in store.rows(run_id):
            store.add_row(row.model_copy(update=changes))


def _quality(row: ResultRow) -> dict[str, Any]:
    return {
        name: getattr(row, name)
        for name in (*QUALITY_COLUMNS, "counters", "kept", "bytes_kept", "artifacts", "visibility_digest", "self_hit")
    }


def test_another_machine_takes_quality_over_and_makes_no_reference(
    tmp_path: Path, asked: list[str], elsewhere: Callable[[], None]
) -> None:
    first = carry_out(planned(tmp_path, "formula:shift=0.25"))
    assert {"measure", "prepare with reference"} <= set(asked)
    asked.clear()
    for entry in (tmp_path / "cache").glob("re*"):
        entry.unlink()
    elsewhere()
    second = carry_out(planned(tmp_path, "formula:shift=0.25"))
    (before,), (after,) = first.rows, second.rows
    assert {"prepare", "summary"} <= set(asked)
    assert not {"measure", "prepare with reference", "kernel"} & set(asked)
    assert not list((tmp_path / "cache").glob("reference-*"))
    assert second.record.run_id != first.record.run_id
    assert (before.quality_run, after.quality_run) == ("", first.record.run_id)
    assert _quality(after) == _quality(before)
    assert (after.machine, after.case_key != before.case_key) == ("another machine", True)
    assert after.samples.keys() == before.samples.keys()
    assert after.samples["shade"] != before.samples["shade"], "times are measured here"
    assert after.rounds == len(after.samples["shade"])


def test_a_changed_plan_times_all_of_its_cases_and_measures_what_is_new(tmp_path: Path, asked: list[str]) -> None:
    first = carry_out(planned(tmp_path, "formula"))
    asked.clear()
    second = carry_out(planned(tmp_path, "formula", "good"))
    assert asked.count("measure") == 1
    assert [row.quality_run for row in second.rows] == [first.record.run_id, ""]
    assert len({row.comparison for row in second.rows}) == 1, "timed in the same rounds"
    third = carry_out(planned(tmp_path, "good", "formula", "formula:shift=1"))
    assert [row.quality_run for row in third.rows] == [second.record.run_id, first.record.run_id, ""], (
        "where it was measured, not where it was seen last"
    )


def test_fresh_takes_nothing_over(tmp_path: Path) -> None:
    carry_out(planned(tmp_path, "formula"))
    (row,) = carry_out(planned(tmp_path, "formula", fresh=True)).rows
    assert row.quality_run == ""


@pytest.mark.parametrize("fresh", [False, True])
def test_numbers_of_threads_share_their_quality(tmp_path: Path, asked: list[str], fresh: bool) -> None:
    one, two = carry_out(planned(tmp_path, "formula", threads=(1, 2), fresh=fresh)).rows
    assert asked.count("measure") == 1
    assert (one.quality_run, two.quality_run) == ("", "")
    assert _quality(one) == _quality(two)


@pytest.mark.parametrize(
    "change",
    [
        {"visibility_digest": "others"},
        {"counters": {"receivers looked at": 1}},
        {"kept": {"shift": 5}},
    ],
)
def test_what_is_not_the_same_is_measured_anew_and_told(
    tmp_path: Path, asked: list[str], change: dict[str, Any]
) -> None:
    first = carry_out(planned(tmp_path, "formula"))
    _tamper(tmp_path, first.record.run_id, **change, failure_count=12345)
    asked.clear()
    second = carry_out(planned(tmp_path, "formula", "good"))
    row = second.row("formula")
    assert asked.count("measure") == 2
    assert asked.count("prepare with reference") >= 1
    assert (row.quality_run, row.failure_count) == ("", 0)
    assert any(first.record.run_id in warning and "should be the same" in warning for warning in row.warnings)
    assert any("should be the same" in note for note in second.seen.notes)
    assert first.rows[0].visibility_digest == row.visibility_digest


@pytest.mark.parametrize("lost", ["picture", "measures"])
def test_quality_that_is_not_whole_is_measured_anew(tmp_path: Path, lost: str) -> None:
    first = carry_out(planned(tmp_path, "formula"))
    if lost == "measures":
        _tamper(tmp_path, first.record.run_id, rmse=None)
    else:
        with Store.open(tmp_path) as store:
            store.artifacts.path(first.rows[0].artifacts["result"]).unlink()
    second = carry_out(planned(tmp_path, "formula", "good"))
    assert [row.quality_run for row in second.rows] == ["", ""]
    with Store.open(tmp_path) as store:
        assert store.artifact(second.rows[0].artifacts["result"])


def test_a_case_that_failed_before_has_no_quality(tmp_path: Path) -> None:
    carry_out(planned(tmp_path, "raises"))
    ended: Ended = carry_out(planned(tmp_path, "raises", "good"))
    assert [row.outcome for row in ended.rows] == [Outcome.ERROR, Outcome.OK]


def test_a_method_that_need_not_repeat_its_bits_is_measured_anew_quietly(tmp_path: Path) -> None:
    first = carry_out(planned(tmp_path, "fickle-allowed"))
    assert first.rows[0].changed_count
    _tamper(tmp_path, first.record.run_id, visibility_digest="others")
    second = carry_out(planned(tmp_path, "fickle-allowed", "good"))
    assert second.row("fickle-allowed").quality_run == ""
    assert not [note for note in second.seen.notes if "should be the same" in note]


@pytest.mark.parametrize(
    ("known", "differs", "is_wrong"),
    [
        ({}, False, False),
        ({"visibility_digest": "others"}, True, True),
        ({"visibility_digest": "others", "machine": "another"}, True, True),
        ({"visibility_digest": "others", "reference_error": 0.0}, True, True),
        ({"visibility_digest": "others", "reference_error": 0.0, "machine": "another"}, True, False),
        ({"counters": {"tests": 8}, "machine": "another"}, True, True),
        ({"counters": {"tests": 7, "found while measuring": 1}}, False, False),
        ({"kept": {}}, True, True),
    ],
)
def test_hard_pixels_counters_and_bytes_are_the_same_everywhere_and_filtered_pixels_on_one_machine(
    known: dict[str, Any], differs: bool, is_wrong: bool
) -> None:
    row = some_row(**({"machine": "this"} | SEEN | known))
    said, wrong = difference(row, SEEN, machine="this", deterministic=True)
    assert (bool(said), wrong) == (differs, is_wrong)
    assert ("another" in said) == (differs and known.get("machine") == "another")
    assert difference(row, SEEN, machine="this", deterministic=False) == (said, False)
