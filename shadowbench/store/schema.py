"""The revision of a results database: read by plain SQL at every opening, brought up to date when it is behind.

A database that is up to date is opened without importing alembic. Making and upgrading happen in one transaction, under
a lock of the folder or, on a server, of the database: another process, or one that is killed meanwhile, sees the old
revision or the new one.
"""

from __future__ import annotations

import fcntl
import os
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path

from sqlalchemy import Connection, Engine, inspect

from shadowbench.errors import StoreError
from shadowbench.store.engine import is_sqlite, use_write_ahead_log, writing

REVISIONS = ("0001", "0002", "0003", "0004", "0005", "0007", "0008", "0009")
"""All revisions, oldest first; the last is this version's. A test holds this to the files in ``migrations``."""


def ensure_current(engine: Engine, database: Path | str, *, read_only: bool = False) -> None:
    """Make the schema of a new database, or upgrade an older one.

    Args:
        engine: The database.
        database: The file, or the server's address without its password.
        read_only: Nothing may be written.

    Raises:
        StoreError: The database is another program's, a newer shadowbench's, or older and cannot be written to.
    """
    with engine.connect() as connection:
        revision = _revision(connection, database)
    if revision == REVISIONS[-1]:
        return
    if read_only:
        raise StoreError(
            f"{database}: has schema {revision}, this version of shadowbench reads {REVISIONS[-1]}, and it may only be"
            " read; copy the folder to where it can be upgraded"
        )
    with _folder_lock(database.parent) if isinstance(database, Path) else nullcontext():
        if is_sqlite(engine):
            use_write_ahead_log(engine)
        with writing(engine).begin() as connection:
            if _revision(connection, database) != REVISIONS[-1]:  # unless another process has done it meanwhile
                upgrade(connection)


def upgrade(connection: Connection, revision: str = REVISIONS[-1]) -> None:
    """Bring the database of ``connection`` to ``revision``, inside the transaction it is in."""
    from alembic import command
    from alembic.config import Config

    configuration = Config()
    configuration.set_main_option("script_location", str(Path(__file__).parent / "migrations").replace("%", "%%"))
    configuration.attributes["connection"] = connection
    command.upgrade(configuration, revision)


def _revision(connection: Connection, database: Path | str) -> str | None:
    """Return the revision of a database, or ``None`` for one that is empty."""
    tables = set(inspect(connection).get_table_names())
    if not tables:
        return None
    other = "give another folder with --results" if isinstance(database, Path) else "give an empty one"
    if "alembic_version" not in tables or "runs" not in tables:
        remedy = f"move it away or {other}" if isinstance(database, Path) else other
        raise StoreError(f"{database}: is another program's database; {remedy}")
    revision = connection.exec_driver_sql("SELECT version_num FROM alembic_version").scalar()
    if revision not in REVISIONS:
        raise StoreError(
            f"{database}: was written by a newer shadowbench (schema {revision}); this version reads up to schema"
            f" {REVISIONS[-1]}: upgrade shadowbench or {other}"
        )
    return str(revision)


@contextmanager
def _folder_lock(folder: Path) -> Iterator[None]:
    """Hold a lock that goes with the process: one at a time makes or upgrades the database of a folder."""
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX)
        yield
    finally:
        os.close(descriptor)
