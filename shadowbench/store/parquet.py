"""Rows as Parquet: typed columns that pandas, DuckDB or R read as they are, and nothing lost on the way back.

One line a row. Texts and numbers are columns of their own type, lists are lists, and stages, counters, kept arrays,
samples and artifacts are maps, in the order in which a method named them; parameters, environment and whatever else has
no fixed shape are JSON texts. A number that is not finite is null, as in the documents.

Files of strangers are read in a process of its own, whose memory is bounded: a few bytes of Parquet can stand for
any number of values, and what they unpack to is known only when it is. It hands over the rows as JSON lines, which
are then checked like any others. Needs pyarrow (``pip install 'shadowbench[parquet]'``), imported where it is used.
"""

from __future__ import annotations

import io
import json
import subprocess
import sys
import types
from collections.abc import Iterator, Sequence
from enum import StrEnum
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any, Union, get_args, get_origin

from shadowbench.errors import StoreError
from shadowbench.rows import ResultRow, column_unit
from shadowbench.store.documents import MOST_ROWS, row_document

if TYPE_CHECKING:
    import pyarrow as pa

_MEMORY = 4 * 2**30
"""What the reading process may use [bytes of address space]."""

_TIMEOUT_S = 120
_ROWS_AT_ONCE = 500


def check_extra() -> None:
    """Make sure that Parquet can be read and written.

    Raises:
        StoreError: pyarrow is not installed.
    """
    if find_spec("pyarrow") is None:
        raise StoreError("rows as Parquet need pyarrow: pip install 'shadowbench[parquet]'; or use --rows csv")


def as_parquet(rows: Sequence[ResultRow]) -> bytes:
    """Return rows as a Parquet file.

    Raises:
        StoreError: pyarrow is not installed.
    """
    check_extra()
    import pyarrow as pa
    from pyarrow import parquet

    documents = [row_document(row) for row in rows]
    fields = _fields()
    columns = [
        pa.array([_value(field.type, document[field.name]) for document in documents], field.type) for field in fields
    ]
    file = io.BytesIO()
    table = pa.Table.from_arrays(columns, schema=pa.schema(fields))
    parquet.write_table(table, file, compression="zstd", row_group_size=_ROWS_AT_ONCE)
    return file.getvalue()


def lines_from_parquet(content: bytes, place: str, largest: int) -> bytes:
    """Return the rows of a Parquet file as JSON lines.

    Args:
        content: The file.
        place: What messages call it.
        largest: How many bytes the lines may have.

    Raises:
        StoreError: It is no such file, or unpacks to more than is allowed; or pyarrow is not installed.
    """
    check_extra()
    command = [sys.executable, "-P", "-m", "shadowbench.store.parquet", str(largest)]
    try:
        done = subprocess.run(command, input=content, capture_output=True, timeout=_TIMEOUT_S, check=False)
    except subprocess.TimeoutExpired:
        raise StoreError(f"{place}: takes too long to read") from None
    if done.returncode == 0:
        return done.stdout
    said = done.stderr.decode("utf-8", "replace").strip().splitlines()
    raise StoreError(f"{place}: {said[-1][:200] if done.returncode == _REFUSED and said else 'cannot be read'}")


_REFUSED = 3


def _fields() -> list[pa.Field]:
    import pyarrow as pa

    found = []
    for name, field in ResultRow.model_fields.items():
        metadata = {"description": field.description or "", "unit": column_unit(name)}
        found.append(pa.field(name, _type(field.annotation), metadata={k: v for k, v in metadata.items() if v}))
    return found


def _type(annotation: Any) -> pa.DataType:
    import pyarrow as pa

    if get_origin(annotation) in (Union, types.UnionType):
        (annotation,) = (each for each in get_args(annotation) if each is not type(None))
    if annotation is int:
        return pa.int64()
    if annotation is float:
        return pa.float64()
    origin, arguments = get_origin(annotation), get_args(annotation)
    if origin is list and arguments[0] is not Any:
        return pa.list_(_type(arguments[0]))
    if origin is dict and arguments[1] is not Any:
        return pa.map_(pa.string(), _type(arguments[1]))
    if annotation is str or (isinstance(annotation, type) and issubclass(annotation, StrEnum)) or origin is not None:
        return pa.string()  # what has no fixed shape as JSON
    raise TypeError(f"no column type for {annotation!r}")


def _value(kind: pa.DataType, value: Any) -> Any:
    """Return a document's value as a column of this type takes it."""
    import pyarrow as pa

    if pa.types.is_map(kind):
        return list(value.items())
    if pa.types.is_string(kind) and not isinstance(value, str | None):
        return json.dumps(value, separators=(",", ":"), allow_nan=False)
    return value


def _documents(content: bytes) -> Iterator[dict[str, Any]]:
    """Yield the documents of a Parquet file."""
    import pyarrow as pa
    from pyarrow import parquet

    file = parquet.ParquetFile(pa.BufferReader(content))
    expected = pa.schema(_fields())
    if not file.schema_arrow.equals(expected):
        names = set(expected.names) ^ set(file.schema_arrow.names)
        raise ValueError(f"does not have the columns of rows: {', '.join(sorted(names))[:100] or 'other types'}")
    if file.metadata.num_rows > MOST_ROWS:
        raise ValueError(f"has {file.metadata.num_rows} rows; {MOST_ROWS} are allowed")
    shapeless = {name for name, field in ResultRow.model_fields.items() if get_origin(field.annotation) is dict}
    maps = {field.name for field in expected if pa.types.is_map(field.type)}
    shapeless -= maps
    for batch in file.iter_batches(batch_size=_ROWS_AT_ONCE):
        for row in batch.to_pylist():
            for name in maps:
                row[name] = dict(row[name])
            for name in shapeless:
                row[name] = json.loads(row[name])
            yield row


def _lines(content: bytes, largest: int) -> Iterator[bytes]:
    for document in _documents(content):
        line = json.dumps(document, separators=(",", ":")).encode("ascii") + b"\n"
        largest -= len(line)
        if largest < 0:
            raise ValueError("unpacks to more than is allowed")
        yield line


def _main() -> int:
    """Read a file from standard input and write its rows to standard output."""
    import resource

    resource.setrlimit(resource.RLIMIT_AS, (_MEMORY, _MEMORY))
    try:
        for line in _lines(sys.stdin.buffer.read(), int(sys.argv[1])):
            sys.stdout.buffer.write(line)
    except MemoryError:
        print("unpacks to more than is allowed", file=sys.stderr)
        return _REFUSED
    except (ValueError, TypeError, KeyError, OSError, RecursionError) as error:  # Arrow's errors are of these
        print(next(iter(str(error).splitlines()), "is damaged"), file=sys.stderr)
        return _REFUSED
    return 0


if __name__ == "__main__":
    sys.exit(_main())
