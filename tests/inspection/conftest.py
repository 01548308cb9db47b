"""Measured cases, and one of them opened again."""

from __future__ import annotations

from pathlib import Path

import pytest
from inspection_cases import measured

from shadowbench.rows import ResultRow


@pytest.fixture(scope="session")
def cases(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, ResultRow]]:
    """Return a results folder, this process's own, and its rows by method."""
    folder = tmp_path_factory.mktemp("cases")
    rows = measured(folder, "shadow-map:resolution=32,slope_bias=0", "pcf:resolution=64", "ray-traced")
    return folder, {row.method: row for row in rows}
