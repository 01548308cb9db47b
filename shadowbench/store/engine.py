"""Connections to the results database: pragmas, transactions, and every database error as a :class:`StoreError`.

The only module that knows SQLite. The driver's own transaction control is switched off (it begins transactions at
statements of its choice); a transaction begins where SQLAlchemy says so, with ``BEGIN IMMEDIATE`` for one that writes,
since SQLite refuses without waiting to turn a reader that others have overtaken into a writer.
"""

from __future__ import annotations

import os
import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from urllib.parse import quote

from pydantic import ValidationError
from pydantic_core import PydanticSerializationError
from sqlalchemy import Connection, Engine, create_engine, event
from sqlalchemy.exc import DBAPIError, SQLAlchemyError
from sqlalchemy.pool import QueuePool

from shadowbench.errors import StoreError

_LOCK_TIMEOUT_S = 30.0

_ELSEWHERE = "give another folder with --results"

_REMEDIES = {
    "database or disk is full": "the disk is full; make room and run again: every finished case is kept",
    "attempt to write a readonly database": f"it may only be read; {_ELSEWHERE}",
    "unable to open database file": f"it cannot be opened; check the folder's permissions or {_ELSEWHERE}",
    "file is not a database": f"it is not a results database; move it away or {_ELSEWHERE}",
    "database is locked": f"another program has kept it locked for {_LOCK_TIMEOUT_S:.0f} s",
    "database disk image is malformed": f"it is damaged; restore a copy or {_ELSEWHERE}",
    "disk I/O error": "the disk reports an error, or is full",
}


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

    engine = create_engine("sqlite+pysqlite://", creator=connect, poolclass=QueuePool)
    event.listen(engine, "begin", _begin)
    return engine


def writing(engine: Engine) -> Engine:
    """Return the same engine for transactions that write."""
    return engine.execution_options(shadowbench_writes=True)


def _begin(connection: Connection) -> None:
    writes = connection.get_execution_options().get("shadowbench_writes", False)
    connection.exec_driver_sql("BEGIN IMMEDIATE" if writes else "BEGIN")


def use_write_ahead_log(engine: Engine) -> None:
    """Make readers and the writer of this database independent of each other; it stays so."""
    connection = engine.raw_connection()  # outside any transaction, where SQLAlchemy would begin one
    try:
        connection.cursor().execute("PRAGMA journal_mode = WAL")
    finally:
        connection.close()


@contextmanager
def store_errors(place: Path, action: str) -> Iterator[None]:
    """Raise whatever goes wrong inside as a :class:`StoreError` of one line.

    Args:
        place: The file or folder in question.
        action: What was tried, e.g. ``"add a row"``.
    """
    try:
        yield
    except OSError as error:
        raise StoreError(f"{place}: cannot {action}: {(error.strerror or str(error)).lower()}") from error
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
        cause = error.orig if isinstance(error, DBAPIError) else error
        first_line = next(iter(str(cause).splitlines()), type(cause).__name__)
        raise StoreError(f"{place}: cannot {action}: {_REMEDIES.get(first_line, first_line)}") from error
