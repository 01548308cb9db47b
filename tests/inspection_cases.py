"""A results folder with measured cases of real techniques, small enough to be made at once."""

from __future__ import annotations

import shutil
from pathlib import Path

import once_a_session
from small_runs import carry_out, kept, planned

from shadowbench.identity import key_of
from shadowbench.rows import ResultRow


def measured(results: Path, *methods: str) -> list[ResultRow]:
    """Measure methods with one round each, once a test session; fill a folder with that and return the rows."""
    name = f"cases-{key_of(methods)}"
    shutil.copytree(once_a_session.made(name, lambda made: _measure(made, methods)), results, dirs_exist_ok=True)
    return kept(results).rows


def _measure(results: Path, methods: tuple[str, ...]) -> None:
    carry_out(planned(results, *methods, scenes=("box-on-plane",), min_rounds=1, max_rounds=1, plugin_files=()))
