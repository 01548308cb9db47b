"""A results folder with one run in it, and a way to add rows to it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from stored_rows import some_row, some_run, with_pictures

from shadowbench.rows import ResultRow, RunRecord
from shadowbench.store import Store


@pytest.fixture
def run() -> RunRecord:
    return some_run()


@pytest.fixture
def store(tmp_path: Path, run: RunRecord) -> Iterator[Store]:
    with Store.open(tmp_path / "results") as opened:
        opened.start_run(run)
        yield opened


@pytest.fixture
def add(store: Store) -> Callable[..., ResultRow]:
    """Return a function that stores a row with the given fields, with pictures if asked, and returns it."""

    def add_row(method: str = "pcf", *, pictures: bool = False, **fields: Any) -> ResultRow:
        row = some_row(method, **fields)
        if pictures:
            row = with_pictures(store, row)
        store.add_row(row)
        return row

    return add_row
