"""A results folder with measured cases of real techniques, small enough to be made at once."""

from __future__ import annotations

from pathlib import Path

from small_runs import carry_out, planned

from shadowbench.rows import ResultRow


def measured(results: Path, *methods: str, scenes: tuple[str, ...] = ("box-on-plane",)) -> list[ResultRow]:
    """Measure methods with one round each, and return their rows."""
    plan = planned(results, *methods, scenes=scenes, min_rounds=1, max_rounds=1, plugin_files=())
    return carry_out(plan).rows
