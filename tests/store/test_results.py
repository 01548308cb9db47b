"""What the rest of the program sees of the store."""

from __future__ import annotations

import os
import shutil
import stat
import tempfile
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from shadowbench.errors import StoreError
from shadowbench.rows import Outcome, RunStatus
from shadowbench.store import DATABASE_NAME, Store
from shadowbench.store.engine import writing

# Opening


def test_a_missing_folder_is_made_or_is_one_line(tmp_path: Path) -> None:
    folder = tmp_path / "a" / "b"
    with pytest.raises(StoreError, match="holds no results; `shadowbench run` makes some"):
        Store.open(folder, create=False)
    assert not folder.exists()
    Store.open(folder).close()
    Store.open(folder, create=False).close()


def test_a_file_in_the_folders_place_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    for create in (True, False):
        with pytest.raises(StoreError, match="is a file, not a results folder"):
            Store.open(tmp_path / "file", create=create)
    with pytest.raises(StoreError, match="cannot make the results folder: not a directory"):
        Store.open(tmp_path / "file" / "below")


def test_a_folder_in_the_databases_place_is_one_line(tmp_path: Path) -> None:
    (tmp_path / DATABASE_NAME).mkdir()
    with pytest.raises(StoreError, match="cannot open the results: it cannot be opened; check"):
        Store.open(tmp_path)


def test_closing_twice_does_no_harm_and_leaves_a_single_file(tmp_path: Path, make_run: Any) -> None:
    store = Store.open(tmp_path)
    store.start_run(make_run())
    store.close()
    store.close()
    assert [path.name for path in tmp_path.iterdir()] == [DATABASE_NAME]


@pytest.fixture
def unprivileged() -> Iterator[Path]:
    """A folder of its own for a process that is not the superuser's, whom no permission stops."""
    folder = Path(tempfile.mkdtemp())
    is_superuser = os.geteuid() == 0
    if is_superuser:
        os.chown(folder, 65534, 65534)
        os.seteuid(65534)
    try:
        yield folder
    finally:
        if is_superuser:
            os.seteuid(0)
        for path in [folder, *folder.rglob("*")]:
            path.chmod(stat.S_IRWXU)
        shutil.rmtree(folder)


def test_a_folder_that_may_only_be_read_can_be_read(unprivileged: Path, make_run: Any, make_row: Any) -> None:
    folder = unprivileged / "results"
    with Store.open(folder) as store:
        store.start_run(make_run())
        store.add_row(make_row())
    folder.chmod(0o555)
    (folder / DATABASE_NAME).chmod(0o444)
    with Store.open(folder, create=False) as store:
        assert len(store.rows("run-1")) == 1
        with pytest.raises(StoreError, match="cannot add a row: it may only be read; give another folder"):
            store.add_row(make_row("second"))
    with pytest.raises(StoreError, match="may only be read; give another folder with --results"):
        Store.open(folder)


def test_what_a_killed_writer_left_in_the_log_is_read_from_a_folder_that_may_only_be_read(
    unprivileged: Path, make_run: Any
) -> None:
    folder, copy = unprivileged / "results", unprivileged / "copy"
    with Store.open(folder) as store:
        store.start_run(make_run())
        shutil.copytree(folder, copy)  # with the log, as a killed process leaves it
    assert (copy / f"{DATABASE_NAME}-wal").stat().st_size > 0
    for path in (*copy.iterdir(), copy):
        path.chmod(0o555)
    with Store.open(copy, create=False) as store:
        assert [run.run_id for run in store.runs()] == ["run-1"]


def test_a_place_where_no_folder_can_be_made_is_one_line(unprivileged: Path) -> None:
    unprivileged.chmod(0o555)
    with pytest.raises(StoreError, match="cannot make the results folder: permission denied"):
        Store.open(unprivileged / "results")


# Runs


def test_a_run_comes_back_as_it_was_recorded(store: Store, make_run: Any) -> None:
    run = make_run(
        plan_key="plan",
        title="Über | <b>",
        experiments=["quick", "tour"],
        argv=["run", "quick"],
        case_count=3,
        environment={"python": "3.11", "cores": 2},
        definitions=[{"name": "quick", "tables": [{"title": "t", "index": ["method"], "values": ["build_ms"]}]}],
        method_defaults={"pcf": {"kernel": 3, "bias": 0.5}},
    )
    store.start_run(run)
    assert store.runs() == [run]


def test_finishing_a_run_records_how_and_when(store: Store, make_run: Any) -> None:
    store.start_run(make_run())
    store.finish_run("run-1", RunStatus.INTERRUPTED, "2026-01-01T01:00:00+00:00")
    (run,) = store.runs()
    assert (run.status, run.finished_at) == (RunStatus.INTERRUPTED, "2026-01-01T01:00:00+00:00")
    store.finish_run("run-1", RunStatus.COMPLETE)
    (run,) = store.runs()
    assert run.status is RunStatus.COMPLETE
    assert run.finished_at is not None
    assert run.finished_at.endswith("+00:00")
    with pytest.raises(StoreError, match="has no run 'other'"):
        store.finish_run("other", RunStatus.COMPLETE)


def test_starting_a_run_again_continues_it(store: Store, make_run: Any, make_row: Any) -> None:
    store.start_run(make_run(plan_key="plan"))
    store.add_row(make_row())
    store.finish_run("run-1", RunStatus.INTERRUPTED)
    store.start_run(store.runs()[0].model_copy(update={"status": RunStatus.RUNNING, "argv": ["again"]}))
    (run,) = store.runs()
    assert (run.status, run.finished_at, run.argv) == (RunStatus.RUNNING, None, ["again"])
    assert len(store.rows("run-1")) == 1
    with pytest.raises(StoreError, match="run 'run-1' is there already and has another plan"):
        store.start_run(make_run(plan_key="other plan"))


def test_runs_come_newest_first_by_their_beginning_then_by_their_order(store: Store, make_run: Any) -> None:
    for run_id, hour in (("b", 2), ("a", 1), ("c", 2), ("d", 0)):
        store.start_run(make_run(run_id, created_at=f"2026-01-01T0{hour}:00:00+00:00"))
    assert [run.run_id for run in store.runs()] == ["c", "b", "a", "d"]


def test_a_run_is_found_by_its_id_a_unique_beginning_or_latest(store: Store, make_run: Any) -> None:
    for hour, run_id in enumerate(("abc1", "abc2", "abc", "xyz9")):
        store.start_run(make_run(run_id, created_at=f"2026-01-01T0{hour}:00:00+00:00"))
    found = {selector: store.find_run(selector).run_id for selector in ("abc1", "abc", "x", "latest")}
    assert found == {"abc1": "abc1", "abc": "abc", "x": "xyz9", "latest": "xyz9"}
    with pytest.raises(StoreError, match=r"3 runs in .* begin with 'a': abc, abc2, abc1"):
        store.find_run("a")
    with pytest.raises(StoreError, match=r"no run in .* is called 'abd1'; did you mean 'abc1'\?"):
        store.find_run("abd1")
    with pytest.raises(StoreError, match=r"no run in .* is called ''"):
        store.find_run("")
    with pytest.raises(StoreError, match="is called '%'"):
        store.find_run("%")


def test_finding_a_run_where_there_is_none_says_how_to_make_one(store: Store) -> None:
    with pytest.raises(StoreError, match="holds no run yet; `shadowbench run` makes one"):
        store.find_run("latest")


def test_an_unfinished_run_of_a_plan_is_the_newest_that_is_not_complete(store: Store, make_run: Any) -> None:
    assert store.unfinished_run("plan") is None
    assert store.last_run("plan") is None
    for hour, run_id in enumerate(("first", "second", "third")):
        store.start_run(make_run(run_id, plan_key="plan", created_at=f"2026-01-01T0{hour}:00:00+00:00"))
    store.start_run(make_run("other", plan_key="other plan", created_at="2026-01-02T00:00:00+00:00"))
    store.finish_run("third", RunStatus.COMPLETE)
    store.finish_run("second", RunStatus.INTERRUPTED)
    unfinished, last = store.unfinished_run("plan"), store.last_run("plan")
    assert unfinished is not None
    assert last is not None
    assert (unfinished.run_id, last.run_id) == ("second", "third")
    store.finish_run("second", RunStatus.COMPLETE)
    store.finish_run("first", RunStatus.COMPLETE)
    assert store.unfinished_run("plan") is None


# Rows


def test_rows_come_in_the_order_of_adding_and_by_experiment(store: Store, make_run: Any, make_row: Any) -> None:
    store.start_run(make_run())
    rows = [
        make_row("z"),
        make_row("a", experiment="tour", outcome="crash", reason="signal 11"),
        make_row("m", samples={"shade": [3.0, 1.0, 2.0], "build": [5.0, 4.0]}, stages={"b": 1.0, "a": 2.0}),
    ]
    for row in rows:
        store.add_row(row)
    assert store.rows("run-1") == rows
    assert store.rows("run-1", "tour") == rows[1:2]
    assert store.rows("run-1", "other") == []
    assert store.finished_case_keys("run-1") == {"z", "a", "m"}
    assert store.finished_case_keys("run-1", "quick") == {"z", "m"}
    assert store.outcome_counts("run-1") == {Outcome.OK: 2, Outcome.CRASH: 1}


def test_a_case_that_is_added_again_takes_its_own_place(store: Store, make_run: Any, make_row: Any) -> None:
    store.start_run(make_run())
    first = make_row("a", outcome="timeout", reason="60 s", counters={"nodes": 1}, samples={"build": [1.0, 2.0]})
    again = make_row("a", counters={"texels": 2}, samples={"shade": [3.0]})
    for row in (first, make_row("b"), again, again):
        store.add_row(row)
    assert store.rows("run-1") == [again, make_row("b")]
    with store.engine.connect() as connection:
        left = {t: connection.exec_driver_sql(f"SELECT count(*) FROM {t}").scalar() for t in ("counters", "samples")}
    assert left == {"counters": 1, "samples": 1}


def test_a_case_counts_once_in_each_experiment_and_run(store: Store, make_run: Any, make_row: Any) -> None:
    store.start_run(make_run())
    store.start_run(make_run("run-2"))
    for row in (make_row(), make_row(experiment="tour"), make_row(run_id="run-2")):
        store.add_row(row)
    assert [row.experiment for row in store.rows("run-1")] == ["quick", "tour"]
    assert len(store.rows("run-2")) == 1


def test_a_row_needs_its_run(store: Store, make_row: Any) -> None:
    with pytest.raises(StoreError, match="has no run 'run-1' to add a row to"):
        store.add_row(make_row())


def test_a_value_that_no_json_can_hold_is_one_line(store: Store, make_run: Any, make_row: Any) -> None:
    store.start_run(make_run())
    with pytest.raises(StoreError, match="cannot add a row: Unable to serialize") as caught:
        store.add_row(make_row(environment={"odd": object()}))
    assert "\n" not in str(caught.value)
    with pytest.raises(StoreError, match=r"cannot read the rows: '\\udc80' is not text"):
        store.rows("\udc80")


def test_rows_of_a_run_that_is_not_there_are_none(store: Store) -> None:
    assert store.rows("nowhere") == []
    assert store.finished_case_keys("nowhere") == set()
    assert store.outcome_counts("nowhere") == {}


def test_sql_in_names_is_text(store: Store, make_run: Any, make_row: Any) -> None:
    hostile = "x'); DROP TABLE rows; --"
    store.start_run(make_run(hostile))
    store.add_row(make_row(hostile, hostile, experiment=hostile, scene=hostile, counters={hostile: 1}))
    assert store.find_run(hostile).run_id == hostile
    assert store.rows(hostile, hostile)[0].counters == {hostile: 1}


def test_a_row_that_this_version_cannot_read_is_one_line(store: Store, make_run: Any, make_row: Any) -> None:
    store.start_run(make_run())
    store.add_row(make_row())
    with writing(store.engine).begin() as connection:
        connection.exec_driver_sql("UPDATE rows SET outcome = 'levitated'")
    with pytest.raises(StoreError, match="cannot read the rows: 'outcome' 'levitated'") as caught:
        store.rows("run-1")
    assert "\n" not in str(caught.value)


def test_threads_share_a_store(store: Store, make_run: Any, make_row: Any) -> None:
    store.start_run(make_run())
    failed: list[BaseException] = []

    def add(name: str) -> None:
        try:
            for i in range(10):
                store.add_row(make_row(f"{name}{i}"))
                store.rows("run-1")
        except BaseException as error:  # noqa: BLE001 - handed to the test
            failed.append(error)

    threads = [threading.Thread(target=add, args=(name,)) for name in "abcd"]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert failed == []
    assert store.finished_case_keys("run-1") == {f"{name}{i}" for name in "abcd" for i in range(10)}


# Pictures


def test_artifacts_lie_in_the_results_folder(store: Store) -> None:
    name = store.put_artifact(b"mask", "png")
    assert store.artifact(name) == b"mask"
    assert (store.folder / "artifacts" / name[:2] / name).read_bytes() == b"mask"
