"""Runs as one file: out of a store and into another, unchanged; and everything that such a file may not be."""

from __future__ import annotations

import json
import math
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from stored_rows import some_row, some_run, with_pictures

from shadowbench.errors import StoreError
from shadowbench.rows import ResultRow
from shadowbench.store import Store
from shadowbench.store.backup import backup, restore
from shadowbench.store.tokens import Scope, TokenBook
from shadowbench.store.transfer import export_runs, import_runs
from shadowbench.tables.csv_text import as_tidy_csv

RUN = some_run(case_count=2)


@pytest.fixture
def rows(store: Store) -> list[ResultRow]:
    """Put a run with a measured and a crashed case into the store."""
    store.start_run(RUN)
    odd = {"stages": {"map": math.nan}, "samples": {"build": [1.0, math.nan]}, "counters": {"n": 2**62}}
    found = [with_pictures(store, some_row(**odd)), some_row("esm", outcome="crash", reason="=1+1 <b>\n'")]
    for row in found:
        store.add_row(row)
    return found


@pytest.fixture
def exported(store: Store, rows: list[ResultRow], tmp_path: Path) -> Path:
    path = tmp_path / "away" / "runs.zip"
    export_runs(store, [RUN], path, as_tidy_csv)
    return path


@pytest.fixture
def other(tmp_path: Path) -> Any:
    with Store.open(tmp_path / "other") as opened:
        yield opened


@pytest.fixture
def changed(exported: Path, tmp_path: Path) -> Callable[..., Path]:
    """Return a function that writes the file again with members changed, added or (``None``) left out."""

    def change(members: dict[str, bytes | None], prefix: str = "") -> Path:
        path = tmp_path / "changed.zip"
        with zipfile.ZipFile(exported) as old, zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as new:
            kept = {name: old.read(name) for name in old.namelist()} | members
            for name, content in kept.items():
                if content is not None:
                    new.writestr(prefix + name, content)
        return path

    return change


def same(row: ResultRow) -> str:
    return row.model_dump_json()  # NaN is not equal to itself


def test_a_run_comes_out_of_another_store_as_it_went_in(
    store: Store, rows: list[ResultRow], exported: Path, other: Store
) -> None:
    (imported,) = import_runs(other, exported)
    assert (imported.kept, imported.row_count) == ("created", 2)
    assert other.runs() == store.runs()
    assert [same(row) for row in other.rows(RUN.run_id)] == [same(row) for row in store.rows(RUN.run_id)]
    for name in rows[0].artifacts.values():
        assert other.artifact(name) == store.artifact(name)


def test_importing_again_changes_nothing(exported: Path, other: Store) -> None:
    import_runs(other, exported)
    (again,) = import_runs(other, exported)
    assert again.kept == "unchanged"
    assert len(other.rows(RUN.run_id)) == 2


def test_another_run_of_the_same_id_is_refused_unless_replacing_is_asked_for(exported: Path, other: Store) -> None:
    other.start_run(RUN)
    other.add_row(some_row("vsm"))
    with pytest.raises(StoreError, match="there already with other content, and was measured here"):
        import_runs(other, exported)
    assert [row.method for row in other.rows(RUN.run_id)] == ["vsm"]
    (imported,) = import_runs(other, exported, replace=True)
    assert imported.kept == "replaced"
    assert [row.method for row in other.rows(RUN.run_id)] == ["pcf", "esm"]


def test_the_csv_beside_the_rows_is_safe_in_a_spreadsheet(exported: Path) -> None:
    with zipfile.ZipFile(exported) as file:
        text = file.read(f"runs/{RUN.run_id}/rows.csv").decode()
    assert "'=1+1 <b>" in text
    assert text.count("\n") == 3


ROWS = f"runs/{RUN.run_id}/rows.jsonl"


@pytest.mark.parametrize(
    ("members", "message"),
    [
        ({"../../evil.txt": b"x"}, "does not belong"),
        ({"/etc/evil": b"x"}, "does not belong"),
        ({f"runs/{RUN.run_id}/../../evil": b"x"}, "does not belong"),
        ({"manifest.json": None}, "lacks manifest.json"),
        ({"manifest.json": b"{}"}, "is not that of 'shadowbench runs'"),
        ({"manifest.json": b'{"format": "shadowbench runs", "version": 2, "runs": []}'}, "is of version 2"),
        ({"manifest.json": b'{"format": "shadowbench runs", "version": 1, "runs": [{"run_id": "../x"}]}'}, "none"),
        ({ROWS: None}, "lacks"),
        ({ROWS: b"[1, NaN]"}, "is not JSON"),
        ({ROWS: b"7"}, r"rows.jsonl\[0\]: is not an object"),
        ({ROWS: b'{"a": 1}'}, r"rows.jsonl\[0\].run_id: Field required"),
        ({ROWS: b""}, "has 0 of the 2 rows of a complete run"),
        ({ROWS: b"[" * 5000}, "is not JSON"),
        ({ROWS: b'{"threads": 1e999}'}, "is not a finite number"),
        ({ROWS: b'{"threads": 99999999999999999999}'}, "is outside 64 bits"),
    ],
)
def test_a_file_that_is_not_what_it_should_be_is_refused_in_one_line(
    changed: Callable[..., Path], other: Store, members: dict[str, bytes | None], message: str
) -> None:
    with pytest.raises(StoreError, match=message) as caught:
        import_runs(other, changed(members))
    assert "\n" not in str(caught.value)
    assert other.runs() == []


def test_a_picture_that_was_changed_or_left_out_is_noticed(
    changed: Callable[..., Path], other: Store, rows: list[ResultRow]
) -> None:
    name = f"artifacts/{rows[0].artifacts['result']}"
    for content, message in ((b"another picture", "is damaged"), (None, f"lacks {name}")):
        with pytest.raises(StoreError, match=message):
            import_runs(other, changed({name: content}))
    assert other.runs() == []


def test_rows_that_were_changed_do_not_have_the_digest_of_the_manifest(
    changed: Callable[..., Path], exported: Path, other: Store
) -> None:
    with zipfile.ZipFile(exported) as file:
        forged = file.read(ROWS).replace(b'"failure_percent":1.25', b'"failure_percent":0.25')
    with pytest.raises(StoreError, match="is not the run that the manifest names"):
        import_runs(other, changed({ROWS: forged}))


def test_a_bomb_is_refused_before_it_is_unpacked(changed: Callable[..., Path], other: Store) -> None:
    with pytest.raises(StoreError, match="unpacks to more than is allowed"):
        import_runs(other, changed({f"runs/{RUN.run_id}/rows.csv": b"0" * 100_000_000}))


def test_what_is_no_archive_is_refused(tmp_path: Path, other: Store, exported: Path) -> None:
    for content in (b"", b"not a zip", exported.read_bytes()[:-200]):
        path = tmp_path / "broken.zip"
        path.write_bytes(content)
        with pytest.raises(StoreError, match="not an undamaged file of runs"):
            import_runs(other, path)
    with pytest.raises(StoreError, match="no such file"):
        import_runs(other, tmp_path / "missing.zip")


def test_an_export_that_fails_leaves_no_file(store: Store, rows: list[ResultRow], tmp_path: Path) -> None:
    store.artifacts.path(rows[0].artifacts["result"]).write_bytes(b"damaged")
    with pytest.raises(StoreError, match="the artifact is damaged"):
        export_runs(store, [RUN], tmp_path / "out" / "runs.zip", as_tidy_csv)
    assert list((tmp_path / "out").iterdir()) == []


def test_a_backup_restores_everything_tokens_and_audit_trail_too(
    store: Store, rows: list[ResultRow], tmp_path: Path, request: pytest.FixtureRequest
) -> None:
    token, text = TokenBook(store).create("lab", Scope.UPLOAD, None)
    backup(store, tmp_path / "backup.zip")
    with zipfile.ZipFile(tmp_path / "backup.zip") as file:
        assert "results.sqlite" in file.namelist()
        assert not [name for name in file.namelist() if name.endswith(("-wal", "-shm"))]
    on_server = store.engine.dialect.name == "postgresql"
    address = request.getfixturevalue("postgresql")() if on_server else None
    restore(tmp_path / "backup.zip", tmp_path / "again", address)
    with Store.open(tmp_path / "again", database=address) as found:
        assert [same(row) for row in found.rows(RUN.run_id)] == [same(row) for row in store.rows(RUN.run_id)]
        assert found.artifact(rows[0].artifacts["result"]) == store.artifact(rows[0].artifacts["result"])
        checked = TokenBook(found).check(text)
        assert checked is not None
        assert checked.token_id == token.token_id
        found.add_row(some_row("vsm"))  # ids go on after the last one
        assert len(found.rows(RUN.run_id)) == 3
    assert (tmp_path / "again" / "results.sqlite").exists() is not on_server


def test_a_backup_is_restored_into_nothing_that_is_there(store: Store, tmp_path: Path) -> None:
    backup(store, tmp_path / "backup.zip")
    (tmp_path / "again").mkdir()
    (tmp_path / "again" / "mine").touch()
    with pytest.raises(StoreError, match="is not empty"):
        restore(tmp_path / "backup.zip", tmp_path / "again")


@pytest.mark.parametrize("name", ["../evil", "artifacts/aa/../../evil", "/evil", "artifacts/ab/" + "c" * 64 + ".png"])
def test_a_backup_with_names_that_lead_elsewhere_is_refused(tmp_path: Path, name: str) -> None:
    with zipfile.ZipFile(tmp_path / "evil.zip", "w") as file:
        file.writestr(name, b"x")
    with pytest.raises(StoreError, match="does not belong into a backup"):
        restore(tmp_path / "evil.zip", tmp_path / "again")
    assert not (tmp_path / "evil").exists()


def test_a_backup_while_others_write_holds_one_state(store: Store, tmp_path: Path) -> None:
    """Each run that it has is whole: it is added in one transaction."""
    import threading

    from shadowbench.store.uploads import Uploader, put_run

    stop = threading.Event()

    def write() -> None:
        number = 0
        while not stop.is_set():
            run = some_run(run_id=f"run-{number}", case_count=3)
            put_run(store, run, [some_row(run_id=run.run_id) for _ in range(3)], Uploader("t"))
            number += 1

    writer = threading.Thread(target=write)
    writer.start()
    try:
        while not store.runs():
            pass
        backup(store, tmp_path / "backup.zip")
    finally:
        stop.set()
        writer.join()
    restore(tmp_path / "backup.zip", tmp_path / "again")
    with Store.open(tmp_path / "again") as found:
        assert found.runs()
        for run in found.runs():
            assert len(found.rows(run.run_id)) == 3


def test_documents_of_every_value_are_json(exported: Path) -> None:
    with zipfile.ZipFile(exported) as file:
        first = json.loads(file.read(ROWS).splitlines()[0])
    assert first["stages"] == {"map": None}
    assert first["samples"] == {"build": [1.0, None]}


@pytest.fixture
def as_parquet_file(store: Store, rows: list[ResultRow], tmp_path: Path) -> Path:
    pytest.importorskip("pyarrow")
    export_runs(store, [RUN], tmp_path / "parquet.zip", None)
    return tmp_path / "parquet.zip"


def test_rows_as_parquet_come_out_of_another_store_as_they_went_in(
    store: Store, as_parquet_file: Path, other: Store
) -> None:
    with zipfile.ZipFile(as_parquet_file) as file:
        assert not [name for name in file.namelist() if name.endswith((".jsonl", ".csv"))]
    (imported,) = import_runs(other, as_parquet_file)
    assert (imported.kept, imported.row_count) == ("created", 2)
    assert [same(row) for row in other.rows(RUN.run_id)] == [same(row) for row in store.rows(RUN.run_id)]


def test_rows_as_parquet_have_typed_columns(as_parquet_file: Path, rows: list[ResultRow]) -> None:
    import io

    import pyarrow as pa
    from pyarrow import parquet

    with zipfile.ZipFile(as_parquet_file) as file:
        table = parquet.read_table(io.BytesIO(file.read(f"runs/{RUN.run_id}/rows.parquet")))
    assert table.column_names == list(ResultRow.model_fields)
    types = {field.name: field.type for field in table.schema}
    assert (types["threads"], types["failure_percent"]) == (pa.int64(), pa.float64())
    assert types["samples"] == pa.map_(pa.string(), pa.list_(pa.float64()))
    assert types["outcome"] == pa.string()
    assert table["counters"].to_pylist()[0] == [("n", 2**62)]
    assert table.schema.field("dynamic_frame_ms").metadata[b"unit"] == b"ms"
    assert json.loads(table["method_parameters"].to_pylist()[0].encode()) == rows[0].method_parameters


def _parquet_of(columns: dict[str, Any]) -> bytes:
    import io

    import pyarrow as pa
    from pyarrow import parquet

    file = io.BytesIO()
    parquet.write_table(pa.table(columns), file)
    return file.getvalue()


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (lambda: b"PAR1 no parquet PAR1", "rows.parquet: "),
        (lambda: b"", "rows.parquet: "),
        (lambda: _parquet_of({"a": [1]}), "does not have the columns of rows"),
    ],
)
def test_parquet_that_is_none_of_ours_is_refused_in_one_line(
    as_parquet_file: Path, other: Store, tmp_path: Path, content: Callable[[], bytes], message: str
) -> None:
    with zipfile.ZipFile(as_parquet_file) as old, zipfile.ZipFile(tmp_path / "changed.zip", "w") as new:
        for name in old.namelist():
            new.writestr(name, content() if name.endswith(".parquet") else old.read(name))
    with pytest.raises(StoreError, match=message) as caught:
        import_runs(other, tmp_path / "changed.zip")
    assert "\n" not in str(caught.value)
    assert other.runs() == []


def test_parquet_that_stands_for_more_than_is_allowed_is_refused(as_parquet_file: Path) -> None:
    """A text of a million characters in each of ten thousand rows takes some kilobytes."""
    import io

    import pyarrow as pa
    from pyarrow import parquet

    from shadowbench.store.parquet import lines_from_parquet

    with zipfile.ZipFile(as_parquet_file) as file:
        table = parquet.read_table(io.BytesIO(file.read(f"runs/{RUN.run_id}/rows.parquet"))).slice(0, 1)
    place = table.column_names.index("reason")
    table = table.set_column(place, table.schema.field("reason"), [pa.array(["x" * 1_000_000], pa.string())])
    bomb = io.BytesIO()
    with parquet.ParquetWriter(bomb, table.schema, compression="zstd") as writer:
        for _ in range(100):
            writer.write_table(table)
    assert len(bomb.getvalue()) < 10_000_000
    with pytest.raises(StoreError, match="unpacks to more than is allowed"):
        lines_from_parquet(bomb.getvalue(), "rows.parquet", 20_000_000)


def test_without_pyarrow_it_is_said_what_to_install(
    store: Store, rows: list[ResultRow], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from shadowbench.store import parquet

    monkeypatch.setattr(parquet, "find_spec", lambda _: None)
    with pytest.raises(StoreError, match=r"pip install 'shadowbench\[parquet\]'"):
        export_runs(store, [RUN], tmp_path / "out" / "runs.zip", None)
    assert not (tmp_path / "out").exists()
