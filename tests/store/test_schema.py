"""Opening brings a database to this version's schema, or says in one line why it cannot."""

from __future__ import annotations

import json
import shutil
import sqlite3
import subprocess
import sys
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest
from alembic import op
from sqlalchemy import Connection, create_engine, text
from stored_rows import some_row, some_run

from shadowbench.errors import StoreError
from shadowbench.rows import LONG_FIELDS
from shadowbench.store import DATABASE_NAME, Store, schema
from shadowbench.store.engine import writing

CURRENT = schema.REVISIONS[-1]


def _execute(folder: Path, *statements: str) -> list[Any]:
    with closing(sqlite3.connect(folder / DATABASE_NAME)) as connection, connection:
        return [connection.execute(statement).fetchall() for statement in statements]


def _opening_fails(folder: Path, match: str) -> None:
    with pytest.raises(StoreError, match=match) as caught:
        Store.open(folder)
    assert "\n" not in str(caught.value)


def test_a_fresh_folder_gets_the_newest_schema_and_a_write_ahead_log(tmp_path: Path) -> None:
    folder = tmp_path / "new" / "deeper % ?#é"
    Store.open(folder).close()
    (revision,), (mode,) = _execute(folder, "SELECT version_num FROM alembic_version", "PRAGMA journal_mode")
    assert revision == (schema.REVISIONS[-1],)
    assert mode == ("wal",)


def test_opening_an_up_to_date_database_does_not_import_alembic(tmp_path: Path) -> None:
    Store.open(tmp_path).close()
    program = (
        "import sys; from pathlib import Path; from shadowbench.store import Store\n"
        "Store.open(Path(sys.argv[1])).close(); print('alembic' in sys.modules, 'warp' in sys.modules)"
    )
    done = subprocess.run(
        [sys.executable, "-c", program, str(tmp_path)], capture_output=True, text=True, check=True, timeout=60
    )
    assert done.stdout.split() == ["False", "False"]


def test_a_database_left_empty_by_a_crash_is_made_anew(tmp_path: Path) -> None:
    (tmp_path / DATABASE_NAME).touch()
    with Store.open(tmp_path) as store:
        assert store.runs() == []


@pytest.fixture
def older_database(tmp_path: Path, make_run: Any) -> Path:
    folder = tmp_path / "older"
    with Store.open(folder) as store:
        store.start_run(make_run("kept"))
    return folder


@pytest.fixture
def newer_version(older_database: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Make this a later shadowbench, whose revision 9002 adds a column."""

    def upgrade(connection: Connection, revision: str = "9002") -> None:
        from alembic.operations import Operations
        from alembic.runtime.migration import MigrationContext

        assert revision == "9002"
        with Operations.context(MigrationContext.configure(connection)):
            op.execute("ALTER TABLE runs ADD COLUMN later TEXT")
            op.execute("UPDATE alembic_version SET version_num = '9002'")

    monkeypatch.setattr(schema, "REVISIONS", (*schema.REVISIONS, "9002"))
    monkeypatch.setattr(schema, "upgrade", upgrade)


@pytest.mark.usefixtures("newer_version")
def test_an_older_database_is_upgraded_when_it_is_opened(older_database: Path) -> None:
    with Store.open(older_database) as store:
        assert [run.run_id for run in store.runs()] == ["kept"]
    ((revision,),) = _execute(older_database, "SELECT version_num FROM alembic_version")
    assert revision == ("9002",)


@pytest.mark.usefixtures("newer_version")
def test_an_upgrade_that_fails_leaves_the_database_as_it_was(
    older_database: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    working = schema.upgrade

    def failing(connection: Connection, revision: str = "9002") -> None:
        working(connection, revision)
        connection.exec_driver_sql("INSERT INTO missing VALUES (1)")

    monkeypatch.setattr(schema, "upgrade", failing)
    _opening_fails(older_database, "cannot open the results: no such table: missing")
    revision, columns = _execute(
        older_database, "SELECT version_num FROM alembic_version", "SELECT name FROM pragma_table_info('runs')"
    )
    assert revision == [(CURRENT,)]
    assert ("later",) not in columns


def test_a_newer_database_is_refused_and_both_versions_are_named(older_database: Path) -> None:
    _execute(older_database, "UPDATE alembic_version SET version_num = '9942'")
    before = (older_database / DATABASE_NAME).read_bytes()
    _opening_fails(
        older_database, rf"newer shadowbench \(schema 9942\); this version reads up to schema {CURRENT}: upgrade"
    )
    assert (older_database / DATABASE_NAME).read_bytes() == before


def test_another_programs_database_is_refused_and_left_alone(tmp_path: Path) -> None:
    _execute(tmp_path, "CREATE TABLE bookmarks (url TEXT)")
    _opening_fails(tmp_path, "is another program's database")
    assert _execute(tmp_path, "SELECT name FROM sqlite_master") == [[("bookmarks",)]]


def test_a_file_that_is_no_database_is_refused_and_left_alone(tmp_path: Path) -> None:
    (tmp_path / DATABASE_NAME).write_bytes(b"triangles, not tables " * 100)
    _opening_fails(tmp_path, "is not a results database")
    assert (tmp_path / DATABASE_NAME).read_bytes().startswith(b"triangles")


def test_a_truncated_database_is_refused(older_database: Path) -> None:
    content = (older_database / DATABASE_NAME).read_bytes()
    (older_database / DATABASE_NAME).write_bytes(content[: len(content) // 2])
    with pytest.raises(StoreError, match=r"it is damaged; restore a copy"), Store.open(older_database) as store:
        store.runs()


def test_several_processes_may_make_the_same_folder_at_once(tmp_path: Path) -> None:
    program = (
        "import sys; from pathlib import Path; from shadowbench.store import Store\n"
        "from shadowbench.rows import RunRecord\n"
        "folder, name = Path(sys.argv[1]), sys.argv[2]\n"
        "sys.stdin.read(1)\n"  # all begin together
        "with Store.open(folder) as store:\n"
        "    for i in range(5): store.start_run(RunRecord(run_id=f'{name}-{i}', created_at='2026'))\n"
    )
    folder = tmp_path / "shared"
    arguments = [sys.executable, "-W", "error", "-c", program, str(folder)]
    workers = [
        subprocess.Popen([*arguments, name], stdin=subprocess.PIPE, stderr=subprocess.PIPE, text=True) for name in "abc"
    ]
    for worker in workers:
        assert worker.stdin is not None
        worker.stdin.write("x")
        worker.stdin.flush()
    for worker in workers:
        _, errors = worker.communicate(timeout=120)
        assert worker.returncode == 0, errors
    with Store.open(folder) as store:
        assert {run.run_id for run in store.runs()} == {f"{name}-{i}" for name in "abc" for i in range(5)}


def test_a_copied_folder_opens(older_database: Path, tmp_path: Path) -> None:
    shutil.copytree(older_database, tmp_path / "copy")
    with Store.open(tmp_path / "copy", create=False) as store:
        assert [run.run_id for run in store.runs()] == ["kept"]


def test_rows_of_the_first_revision_have_one_sample_a_pixel_and_no_later_measure(tmp_path: Path) -> None:
    """A database as revision 0001 made it, with a row in it."""
    engine = create_engine(f"sqlite:///{tmp_path / DATABASE_NAME}")
    with engine.begin() as connection:
        schema.upgrade(connection, "0001")
        run, row = some_run(), some_row()
        later = {"pixel_samples", "layers", "moving", "quality_run", "changed_count"}
        later |= {"edge_band_rmse", "interior_rmse", "approximation_rmse", "discretisation_rmse"}
        later |= {"baseline_case", "processes", "ended_by", "warm_up_frames", "build_repeats", "shade_repeats"}
        later |= {"unexplained_ms", "round_processes", "outlier_rounds"}
        stored = row.model_dump(mode="json", exclude=set(LONG_FIELDS) | later)
        for table, values in (("runs", run.model_dump(mode="json")), ("rows", stored)):
            plain = {k: json.dumps(v) if isinstance(v, dict | list) else v for k, v in values.items()}
            names, places = ", ".join(plain), ", ".join(f":{name}" for name in plain)
            connection.execute(text(f"INSERT INTO {table} ({names}) VALUES ({places})"), plain)
    engine.dispose()
    with Store.open(tmp_path) as store:
        (found,) = store.rows(run.run_id)
    assert found == row
    assert (found.pixel_samples, found.layers, found.moving) == (1, 1, "everything")
    assert found.interior_rmse is found.approximation_rmse is None


def test_rows_from_before_leaderboards_get_the_keys_that_they_are_grouped_by(
    store: Store, make_run: Any, make_row: Any
) -> None:
    """What the migration fills in is what a row that is added today gets."""
    from shadowbench.store.migrations.versions import r0008_service

    store.start_run(make_run())
    row = make_row(
        scene_parameters={"b": 1, "a": [0.1, "é"]}, method_parameters={"bias": 1e-05, "on": True, "none": None}
    )
    store.add_row(row)
    keys = "SELECT view_key, technique_key FROM rows"
    with store.engine.connect() as connection:
        expected = connection.exec_driver_sql(keys).all()
    from alembic.operations import Operations
    from alembic.runtime.migration import MigrationContext

    with writing(store.engine).begin() as connection:
        connection.exec_driver_sql("UPDATE rows SET view_key = '', technique_key = ''")
        with Operations.context(MigrationContext.configure(connection)):
            r0008_service._fill_in()
    with store.engine.connect() as connection:
        assert connection.exec_driver_sql(keys).all() == expected
    assert all(len(key) == 16 for key in expected[0])
