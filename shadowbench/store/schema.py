"""The revision of a results database: read by plain SQL at every opening, brought up to date when it is behind.

A database that is up to date is opened without importing alembic. Making and upgrading happen under a lock of the
folder and in one transaction: another process, or one that is killed meanwhile, sees the old revision or the new one.
"""

from __future__ import annotations

import fcntl
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from sqlalchemy import Connection, Engine

from shadowbench.errors import StoreError
from shadowbench.store.engine import use_write_ahead_log, writing

REVISIONS = ("0001", "0002", "0003", "0005", "0007")
"""All revisions, oldest first; the last is this version's. A test holds this to the files in ``migrations``."""


def ensure_current(engine: Engine, database: Path, *, read_only: bool = False) -> None:
    """Make the schema of a new database, or upgrade an older one.

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
    with _folder_lock(database.parent):
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


def _revision(connection: Connection, database: Path) -> str | None:
    """Return the revision of a database, or ``None`` for one that is empty."""
    tables = set(connection.exec_driver_sql("SELECT name FROM sqlite_master WHERE type = 'table'").scalars())
    if not tables:
        return None
    if "alembic_version" not in tables or "runs" not in tables:
        raise StoreError(
            f"{database}: is another program's database; move it away or give another folder with --results"
        )
    revision = connection.exec_driver_sql("SELECT version_num FROM alembic_version").scalar()
    if revision not in REVISIONS:
        raise StoreError(
            f"{database}: was written by a newer shadowbench (schema {revision}); this version reads up to schema"
            f" {REVISIONS[-1]}: upgrade shadowbench or give another folder with --results"
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
