"""Connections to the results database: pragmas, transactions, and every database error as a :class:`StoreError`.

The only module that knows which database there is. Every transaction reads one state throughout, and one at a time
writes.

*SQLite*: the driver's own transaction control is switched off (it begins transactions at statements of its choice); a
transaction begins where SQLAlchemy says so, with ``BEGIN IMMEDIATE`` for one that writes, since SQLite refuses without
waiting to turn a reader that others have overtaken into a writer.

*PostgreSQL*: readers are ``REPEATABLE READ, READ ONLY``; a writer first takes an advisory lock that ends with its
transaction, so that what it reads is what it changes.
"""

from __future__ import annotations

import errno
import os
import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from urllib.parse import quote

from pydantic import ValidationError
from pydantic_core import PydanticSerializationError
from sqlalchemy import URL, Connection, Engine, create_engine, event, make_url
from sqlalchemy.exc import ArgumentError, DBAPIError, SQLAlchemyError
from sqlalchemy.pool import QueuePool

from shadowbench.errors import StorageFullError, StoreError

_LOCK_TIMEOUT_S = 30.0

_ELSEWHERE = "give another folder with --results"

_FILE_FULL = "database or disk is full"

_FILE_ERROR = "disk I/O error"

_ROOM = 2**16
"""Less room than that on a disk is none [bytes]: files of SQLite's log grow by half of it."""

_REMEDIES = {
    _FILE_FULL: "the disk is full; make room and run again: every finished case is kept",
    "attempt to write a readonly database": f"it may only be read; {_ELSEWHERE}",
    "unable to open database file": f"it cannot be opened; check the folder's permissions or {_ELSEWHERE}",
    "file is not a database": f"it is not a results database; move it away or {_ELSEWHERE}",
    "database is locked": f"another program has kept it locked for {_LOCK_TIMEOUT_S:.0f} s",
    "database disk image is malformed": f"it is damaged; restore a copy or {_ELSEWHERE}",
    _FILE_ERROR: "the disk reports an error, or is full",
}

_DISK_FULL = "53100"
"""PostgreSQL's SQLSTATE of a full disk."""

_SERVER_REMEDIES = {
    _DISK_FULL: "the server's disk is full; make room there: everything kept so far is intact",
    "22003": "a whole number is outside 64 bits",
    "55P03": "another program has kept it locked",
}

_WRITER_LOCK = 0x5AD0BE2C
"""The advisory lock that one writer at a time holds."""


def make_engine(database: Path, *, read_only: bool = False) -> Engine:
    """Return an engine for a database file, which is made at the first connection if it is missing.

    Args:
        database: The file.
        read_only: Open it as it lies there, without the write-ahead log's files, which a folder that cannot be written
            to has no place for.
    """
    mode = "rwc"
    if read_only:
        beside_log = database.with_name(database.name + "-wal")
        mode = "ro" if beside_log.exists() and beside_log.stat().st_size > 0 else "ro&immutable=1"
    location = f"file:{quote(os.fspath(database.absolute()))}?mode={mode}"

    def connect() -> sqlite3.Connection:
        connection = sqlite3.connect(
            location, uri=True, timeout=_LOCK_TIMEOUT_S, isolation_level=None, check_same_thread=False
        )
        connection.execute("PRAGMA foreign_keys = ON")
        connection.execute("PRAGMA synchronous = FULL")  # a commit is on the disk before it returns
        return connection

    engine = create_engine("sqlite+pysqlite://", creator=connect, poolclass=QueuePool, pool_size=10, max_overflow=50)
    event.listen(engine, "begin", _begin_sqlite)
    return engine


def server_url(text: str) -> URL:
    """Return the address of a PostgreSQL database, read by psycopg 3.

    Args:
        text: ``postgresql://user@host/database``; a password may stand in it, in ``PGPASSWORD`` or in ``~/.pgpass``.

    Raises:
        StoreError: It is no such address, or psycopg is not installed.
    """
    try:
        url = make_url(text)
    except ArgumentError:
        raise StoreError("the database's address is not like postgresql://user@host/database") from None
    if url.drivername not in ("postgresql", "postgres", "postgresql+psycopg"):
        raise StoreError(f"'{url.drivername}' databases are not supported; give postgresql://user@host/database")
    if find_spec("psycopg") is None:
        raise StoreError("PostgreSQL needs psycopg: pip install 'shadowbench[postgres]'")
    return url.set(drivername="postgresql+psycopg")


def make_server_engine(url: URL) -> Engine:
    """Return an engine for a database of a PostgreSQL server."""
    engine = create_engine(
        url,
        pool_size=10,
        max_overflow=50,
        pool_pre_ping=True,
        connect_args={"connect_timeout": 10, "options": f"-c lock_timeout={_LOCK_TIMEOUT_S:.0f}s"},
    )
    event.listen(engine, "begin", _begin_server)
    return engine


def is_sqlite(engine: Engine) -> bool:
    """Return whether the database is a file."""
    return engine.dialect.name == "sqlite"


def writing(engine: Engine) -> Engine:
    """Return the same engine for transactions that write."""
    return engine.execution_options(shadowbench_writes=True)


def _begin_sqlite(connection: Connection) -> None:
    connection.exec_driver_sql("BEGIN IMMEDIATE" if _writes(connection) else "BEGIN")


def _begin_server(connection: Connection) -> None:
    if _writes(connection):
        connection.exec_driver_sql(f"SELECT pg_advisory_xact_lock({_WRITER_LOCK})")
    else:
        connection.exec_driver_sql("SET TRANSACTION ISOLATION LEVEL REPEATABLE READ, READ ONLY")


def _writes(connection: Connection) -> bool:
    return bool(connection.get_execution_options().get("shadowbench_writes", False))


def use_write_ahead_log(engine: Engine) -> None:
    """Make readers and the writer of this database independent of each other; it stays so."""
    connection = engine.raw_connection()  # outside any transaction, where SQLAlchemy would begin one
    try:
        connection.cursor().execute("PRAGMA journal_mode = WAL")
    finally:
        connection.close()


@contextmanager
def store_errors(place: Path | str, action: str) -> Iterator[None]:
    """Raise whatever goes wrong inside as a :class:`StoreError` of one line.

    Args:
        place: The file, folder or database in question.
        action: What was tried, e.g. ``"add a row"``.

    Raises:
        StorageFullError: There is no room.
        StoreError: Anything else.
    """
    try:
        yield
    except OSError as error:
        kind = StorageFullError if error.errno in (errno.ENOSPC, errno.EDQUOT) else StoreError
        raise kind(f"{place}: cannot {action}: {(error.strerror or str(error)).lower()}") from error
    except OverflowError as error:
        raise StoreError(f"{place}: cannot {action}: a whole number is outside 64 bits") from error
    except UnicodeEncodeError as error:
        raise StoreError(f"{place}: cannot {action}: {error.object!a:.60} is not text that UTF-8 can hold") from error
    except PydanticSerializationError as error:
        raise StoreError(f"{place}: cannot {action}: {str(error).splitlines()[0]}") from error
    except ValidationError as error:
        first = error.errors()[0]
        field = ".".join(str(part) for part in first["loc"])
        raise StoreError(f"{place}: cannot {action}: '{field}' {first['input']!r:.60}: {first['msg']}") from error
    except (SQLAlchemyError, sqlite3.Error) as error:
        cause = error.orig if isinstance(error, DBAPIError) and error.orig is not None else error
        raise _database_error(place, action, cause) from error


def _database_error(place: Path | str, action: str, cause: BaseException) -> StoreError:
    first_line = next(iter(str(cause).splitlines()), type(cause).__name__)
    state = getattr(cause, "sqlstate", None)
    remedy = _SERVER_REMEDIES.get(state) if state else _REMEDIES.get(first_line)
    is_full = state == _DISK_FULL or first_line == _FILE_FULL or (first_line == _FILE_ERROR and _has_no_room(place))
    remedy = _REMEDIES[_FILE_FULL] if is_full and not state else remedy
    return (StorageFullError if is_full else StoreError)(f"{place}: cannot {action}: {remedy or first_line}")


def _has_no_room(place: Path | str) -> bool:
    """Return whether a database's disk is full: where its log's index cannot grow, SQLite only tells of an error."""
    if not isinstance(place, Path):
        return False
    try:
        disk = os.statvfs(place.parent)
    except OSError:
        return False
    return disk.f_bavail * disk.f_frsize < _ROOM
