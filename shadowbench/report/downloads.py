"""What a reader can take out of the page: rows and tables as files, inside it, without a network.

A download is a link to a ``data:`` address. Rows are many, so they are compressed: without the script the link saves a
``.gz`` file, and the script unpacks it and saves the file itself. The texts are those of the ``table`` command, with
its guards against spreadsheets that take a text for a formula.
"""

from __future__ import annotations

import base64
import gzip
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import cast

from shadowbench import tables
from shadowbench.rows import ResultRow, RunRecord
from shadowbench.tables.csv_text import as_tidy_csv
from shadowbench.tables.table import Table

_LARGE = 4_000
"""Characters from which on a table is compressed."""


@dataclass(frozen=True)
class Download:
    """A file in the page.

    Attributes:
        label: What the link says.
        file_name: What it is saved as, uncompressed.
        address: ``data:`` address.
        is_packed: Whether the address holds it compressed by gzip.
    """

    label: str
    file_name: str
    address: str
    is_packed: bool = False


def run_downloads(run: RunRecord, rows: Sequence[ResultRow]) -> list[Download]:
    """Return a run's rows as CSV and, with their samples, as JSON Lines."""
    stem = re.sub(r"[^A-Za-z0-9._-]+", "-", run.run_id)[:80]
    lines = "".join(row.model_dump_json() + "\n" for row in rows)
    return [
        _packed("All rows as CSV", f"{stem}.csv", as_tidy_csv(rows)),
        _packed("All rows as JSON Lines, with samples", f"{stem}.jsonl", lines),
    ]


def table_download(table: Table, number: str) -> Download:
    """Return a table in its own shape as CSV."""
    text = cast("str", tables.render([table], "csv-table"))
    if len(text) > _LARGE:
        return _packed("CSV", f"table-{number}.csv", text)
    content = base64.b64encode(text.encode("utf-8", "replace")).decode("ascii")
    return Download("CSV", f"table-{number}.csv", f"data:text/csv;charset=utf-8;base64,{content}")


def _packed(label: str, file_name: str, text: str) -> Download:
    packed = gzip.compress(text.encode("utf-8", "replace"), mtime=0)
    content = base64.b64encode(packed).decode("ascii")
    return Download(label, file_name, f"data:application/gzip;base64,{content}", is_packed=True)
