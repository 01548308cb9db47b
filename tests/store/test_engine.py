"""Transactions and errors of the database itself."""

from __future__ import annotations

import os
import sqlite3
from contextlib import closing
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from sqlalchemy.exc import OperationalError

from shadowbench.errors import StorageFullError, StoreError
from shadowbench.store import DATABASE_NAME, Store
from shadowbench.store import engine as engine_module
from shadowbench.store.engine import store_errors, writing


@pytest.fixture
def database() -> None:
    """The tests of this module are about SQLite."""


def test_a_connection_has_the_pragmas_that_durability_needs(store: Store) -> None:
    with store.engine.connect() as connection:
        pragmas = {
            name: connection.exec_driver_sql(f"PRAGMA {name}").scalar()
            for name in ("journal_mode", "synchronous", "foreign_keys", "busy_timeout")
        }
    full = 2
    assert pragmas == {"journal_mode": "wal", "synchronous": full, "foreign_keys": 1, "busy_timeout": 30_000}


def test_a_writer_locks_out_other_writers_from_its_beginning_and_no_reader(store: Store, make_run: Any) -> None:
    store.start_run(make_run("before"))
    with writing(store.engine).begin() as connection:
        other = sqlite3.connect(store.folder / DATABASE_NAME, timeout=0)
        with closing(other), pytest.raises(sqlite3.OperationalError, match="locked"):
            other.execute("BEGIN IMMEDIATE")
        connection.exec_driver_sql("DELETE FROM runs")
        assert [run.run_id for run in store.runs()] == ["before"]
    assert store.runs() == []


def test_a_reader_sees_one_state_throughout_its_transaction(store: Store, make_run: Any) -> None:
    with store.engine.begin() as reader:
        count = "SELECT count(*) FROM runs"
        assert reader.exec_driver_sql(count).scalar() == 0
        store.start_run(make_run())
        assert reader.exec_driver_sql(count).scalar() == 0
    assert len(store.runs()) == 1


def test_a_statement_that_fails_undoes_its_whole_transaction(store: Store, make_run: Any) -> None:
    store.start_run(make_run())

    def delete_twice() -> None:
        with writing(store.engine).begin() as connection:
            connection.exec_driver_sql("DELETE FROM runs")
            connection.exec_driver_sql("DELETE FROM missing")

    with pytest.raises(OperationalError):
        delete_twice()
    assert len(store.runs()) == 1


def test_a_locked_database_is_one_line_after_the_timeout(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, make_run: Any
) -> None:
    monkeypatch.setattr(engine_module, "_LOCK_TIMEOUT_S", 0.0)
    with Store.open(tmp_path) as store, closing(sqlite3.connect(tmp_path / DATABASE_NAME)) as other:
        other.execute("BEGIN IMMEDIATE")
        with pytest.raises(StoreError, match="cannot record the run: another program has kept it locked"):
            store.start_run(make_run())


def test_a_full_disk_loses_nothing_and_the_store_goes_on_when_there_is_room(
    store: Store, make_run: Any, make_row: Any
) -> None:
    store.start_run(make_run())
    store.add_row(make_row("first"))
    with store.engine.connect() as connection:  # pooled: the next transaction has this connection
        pages = connection.exec_driver_sql("PRAGMA page_count").scalar()
        connection.exec_driver_sql(f"PRAGMA max_page_count = {pages}")
    with pytest.raises(StoreError, match="the disk is full; make room and run again") as caught:
        store.add_row(make_row("second", stderr_tail="x" * 100_000, samples={"build": [1.0] * 1000}))
    assert "\n" not in str(caught.value)
    assert store.finished_case_keys("run-1") == {"first"}
    with store.engine.connect() as connection:
        connection.exec_driver_sql("PRAGMA max_page_count = 1000000")
    store.add_row(make_row("second"))
    assert store.finished_case_keys("run-1") == {"first", "second"}


@pytest.mark.parametrize(("free", "is_full"), [(0, True), (100, False)])
def test_an_error_of_the_disk_is_one_of_room_where_there_is_none(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, free: int, is_full: bool
) -> None:
    monkeypatch.setattr(os, "statvfs", lambda _: SimpleNamespace(f_bavail=free, f_frsize=4096))
    with pytest.raises(StoreError) as caught, store_errors(tmp_path / DATABASE_NAME, "look"):
        raise sqlite3.OperationalError("disk I/O error")
    assert isinstance(caught.value, StorageFullError) is is_full
    assert ("make room" in str(caught.value)) is is_full


@pytest.mark.parametrize(
    ("raised", "message"),
    [
        (PermissionError(13, "Permission denied"), "here: cannot look: permission denied"),
        (OSError("odd"), "here: cannot look: odd"),
        (OverflowError("too large"), "here: cannot look: a whole number is outside 64 bits"),
        (sqlite3.OperationalError("disk I/O error"), "here: cannot look: the disk reports an error, or is full"),
        (sqlite3.OperationalError("first\nsecond"), "here: cannot look: first"),
        (sqlite3.OperationalError(), "here: cannot look: OperationalError"),
    ],
)
def test_every_error_is_one_line_that_says_where_and_what(raised: Exception, message: str) -> None:
    with pytest.raises(StoreError) as caught, store_errors(Path("here"), "look"):
        raise raised
    assert str(caught.value) == message
