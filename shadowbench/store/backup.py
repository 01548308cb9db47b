"""A copy of everything, safe while others write: ``backup`` and ``restore``.

A backup is a results folder as a zip archive: an SQLite database with every table (tokens and the audit trail too), and
the pictures and masks. It is copied in one read transaction, so it holds one state of the database whichever that is,
and every file that this state names, since files are there before rows name them. Unpacking it into an empty folder
restores it; :func:`restore` does that, or fills an empty PostgreSQL database.
"""

from __future__ import annotations

import os
import secrets
import tempfile
import zipfile
from pathlib import Path

from sqlalchemy import Engine, func, insert, select, text

from shadowbench.errors import StoreError
from shadowbench.store.access_models import StoredToken
from shadowbench.store.artifacts import ARTIFACT_NAME
from shadowbench.store.engine import is_sqlite, make_engine, store_errors, writing
from shadowbench.store.models import StoredArtifact
from shadowbench.store.results import DATABASE_NAME, Store
from shadowbench.store.transfer import LARGEST_ARTIFACT, written_whole

_AT_ONCE = 5000
_TABLES = StoredToken.metadata.sorted_tables


def backup(store: Store, path: Path) -> None:
    """Write a backup; the file appears whole or not at all.

    Raises:
        StoreError: A picture is missing or damaged, or the file cannot be written.
    """
    with (
        written_whole(path, "write the backup") as partial,
        tempfile.TemporaryDirectory(dir=path.parent, prefix=f".{path.name}.") as folder,
    ):
        database = Path(folder) / DATABASE_NAME
        with Store.open(Path(folder)) as copy:
            _copy(store.engine, copy.engine)
            with copy.session("list the pictures") as session:
                names = session.execute(select(StoredArtifact.value).distinct()).scalars().all()
            copy.engine.dispose()
        _leave_write_ahead_log(database)
        with zipfile.ZipFile(partial, "w", zipfile.ZIP_DEFLATED) as file:
            file.write(database, DATABASE_NAME)
            for name in names:
                member = f"artifacts/{name[:2]}/{name}"
                file.writestr(member, store.artifact(name), compress_type=zipfile.ZIP_STORED)


def restore(path: Path, folder: Path, database: str | None = None) -> None:
    """Make a store of a backup.

    Args:
        path: What :func:`backup` wrote.
        folder: A results folder that is empty or missing.
        database: Address of an empty PostgreSQL database to hold the runs instead.

    Raises:
        StoreError: The file is no backup, or there is something already.
    """
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise StoreError(f"{folder}: is not empty; a backup is restored into an empty folder")
    with store_errors(path, "restore the backup"):
        folder.mkdir(parents=True, exist_ok=True)
        try:
            with zipfile.ZipFile(path) as file:
                _unpack(file, path, folder)
        except (zipfile.BadZipFile, EOFError, NotImplementedError, RuntimeError) as error:
            raise StoreError(f"{path}: is not an undamaged backup: {error}") from error
    with Store.open(folder, create=True) as unpacked:  # upgrades one of an older version
        if database is None:
            return
        with Store.open(folder, database=database) as target:
            with target.session("look for runs") as session:
                held = any(session.execute(select(func.count()).select_from(table)).scalar() for table in _TABLES)
            if held:
                raise StoreError(f"{target.place}: is not empty; a backup is restored into an empty database")
            with store_errors(target.place, "restore the backup"):
                _copy(unpacked.engine, target.engine)
    for leftover in folder.glob(f"{DATABASE_NAME}*"):
        leftover.unlink()


def _copy(source: Engine, target: Engine) -> None:
    """Copy every table of one state of a database into an empty one."""
    with source.begin() as reading, writing(target).begin() as into:
        for table in _TABLES:
            rows = reading.execution_options(yield_per=_AT_ONCE).execute(select(table))
            for part in rows.mappings().partitions():
                into.execute(insert(table), [dict(row) for row in part])
            if not is_sqlite(target) and "id" in table.c:  # the next id follows the last one
                into.execute(
                    text(
                        f"SELECT setval(pg_get_serial_sequence('{table.name}', 'id'),"  # noqa: S608 - our own names
                        f" (SELECT coalesce(max(id), 0) + 1 FROM {table.name}), false)"
                    )
                )


def _leave_write_ahead_log(database: Path) -> None:
    """Let the file be whole by itself, without a log beside it."""
    engine = make_engine(database)
    connection = engine.raw_connection()
    try:
        connection.cursor().execute("PRAGMA journal_mode = DELETE")
    finally:
        connection.close()
        engine.dispose()


def _unpack(file: zipfile.ZipFile, path: Path, folder: Path) -> None:
    allowed = 200 * path.stat().st_size + LARGEST_ARTIFACT
    for member in file.infolist():
        name = member.filename.rpartition("/")[2]
        is_artifact = ARTIFACT_NAME.fullmatch(name) and member.filename == f"artifacts/{name[:2]}/{name}"
        if not (is_artifact or member.filename == DATABASE_NAME):
            raise StoreError(f"{path}: {member.filename!a:.80} does not belong into a backup")
        allowed -= member.file_size
        if allowed < 0:
            raise StoreError(f"{path}: unpacks to more than is allowed")
    for member in file.infolist():
        target = folder / member.filename
        target.parent.mkdir(parents=True, exist_ok=True)
        partial = target.with_name(f".{target.name}.{secrets.token_hex(4)}")
        with file.open(member) as content, partial.open("wb") as out:
            while part := content.read(2**20):
                out.write(part)
            out.flush()
            os.fsync(out.fileno())
        partial.replace(target)
    if not (folder / DATABASE_NAME).is_file():
        raise StoreError(f"{path}: lacks {DATABASE_NAME}: it is not a backup")
