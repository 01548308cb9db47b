"""Files to take out of the page."""

from __future__ import annotations

import base64
import csv
import gzip
import io
import json

from stored_rows import some_row, some_run

from shadowbench import tables
from shadowbench.report.downloads import Download, run_downloads, table_download


def content(download: Download) -> str:
    held = base64.b64decode(download.address.partition(";base64,")[2])
    return (gzip.decompress(held) if download.is_packed else held).decode("utf-8")


def test_rows_come_out_as_csv_and_json_lines() -> None:
    rows = [some_row("pcf", samples={"shade": [1.0, 2.0]}), some_row("esm", reason="=1+1", outcome="error")]
    as_csv, as_json = run_downloads(some_run(), rows)
    lines = list(csv.DictReader(io.StringIO(content(as_csv))))
    assert [line["method"] for line in lines] == ["pcf", "esm"]
    assert lines[1]["reason"] == "'=1+1"  # no formula for a spreadsheet
    assert [json.loads(line)["method"] for line in content(as_json).splitlines()] == ["pcf", "esm"]
    assert json.loads(content(as_json).splitlines()[0])["samples"] == {"shade": [1.0, 2.0]}


def test_the_same_rows_make_the_same_address() -> None:
    rows = [some_row("pcf")]
    assert run_downloads(some_run(), rows) == run_downloads(some_run(), rows)


def test_file_names_are_safe_whatever_the_run_is_called() -> None:
    as_csv, _ = run_downloads(some_run(run_id='../"<\u202e>'), [some_row()])
    assert as_csv.file_name == "..-.csv"


def test_a_table_comes_out_in_its_own_shape() -> None:
    (table,) = tables.make([some_row("pcf"), some_row("esm")], run=some_run())
    download = table_download(table, "1-1")
    assert (download.file_name, download.is_packed) == ("table-1-1.csv", False)
    assert content(download) == tables.render([table], "csv-table")


def test_a_large_table_is_compressed() -> None:
    (table,) = tables.make([some_row("pcf", reason="long " * 2000, outcome="error")], run=some_run())
    download = table_download(table, "1-1")
    assert download.is_packed
    assert content(download) == tables.render([table], "csv-table")
