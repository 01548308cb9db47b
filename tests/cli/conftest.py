"""The command line in this process: arguments in; exit status, standard output and standard error out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pytest
from stored_rows import some_row, some_run, with_pictures

from shadowbench.cli import main
from shadowbench.store import Store


@dataclass(frozen=True)
class Ended:
    """How a command ended."""

    status: int
    out: str
    err: str


@pytest.fixture
def command(capfd: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., Ended]:
    """Return a function that runs one command in an empty folder."""
    monkeypatch.chdir(tmp_path)
    for name in ("SHADOWBENCH_RESULTS", "SHADOWBENCH_DEBUG", "COLUMNS", "FORCE_COLOR"):
        monkeypatch.delenv(name, raising=False)

    def run(*arguments: str) -> Ended:
        capfd.readouterr()
        status = main(arguments)
        captured = capfd.readouterr()
        return Ended(status, captured.out, captured.err)

    return run


@pytest.fixture
def results(tmp_path: Path) -> Path:
    """Return a results folder with two runs, the newer one holding a measured and a skipped case."""
    folder = tmp_path / "kept"
    with Store.open(folder) as store:
        store.start_run(some_run(run_id="20250101-000000-0000", created_at="2025-01-01T00:00:00+00:00"))
        store.start_run(some_run(case_count=2))
        store.add_row(with_pictures(store, some_row("pcf")))
        store.add_row(some_row("embree", outcome="skipped", reason="not installed"))
    return folder
