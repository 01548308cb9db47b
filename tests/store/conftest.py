"""A store in a fresh folder, and rows to put into it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from shadowbench.rows import Outcome, ResultRow, RunRecord
from shadowbench.store import Store

RowMaker = Callable[..., ResultRow]


@pytest.fixture
def store(tmp_path: Path, database: str | None) -> Iterator[Store]:
    with Store.open(tmp_path / "results", database=database) as opened:
        yield opened


@pytest.fixture
def make_run() -> Callable[..., RunRecord]:
    def make(run_id: str = "run-1", **fields: Any) -> RunRecord:
        return RunRecord.model_validate({"run_id": run_id, "created_at": "2026-01-01T00:00:00+00:00"} | fields)

    return make


@pytest.fixture
def make_row() -> RowMaker:
    def make(case_key: str = "case-1", run_id: str = "run-1", **fields: Any) -> ResultRow:
        given = {
            "run_id": run_id,
            "experiment": "quick",
            "case_key": case_key,
            "quality_key": "quality",
            "scene": "bunny",
            "method": "pcf",
            "light": "sun",
            "camera": "main",
            "width": 64,
            "height": 48,
            "device": "cpu",
            "threads": 2,
            "outcome": Outcome.OK,
        }
        return ResultRow.model_validate(given | fields)

    return make
