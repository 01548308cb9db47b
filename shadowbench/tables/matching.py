"""Cases of two runs that measure the same, whichever code, machine or experiment file they come from.

Matched by what is measured, never by key: scene and parameters, light, camera, size, samples, layers, what moves,
method and parameters, device, threads. A mesh file counts by its name, since another machine keeps it elsewhere. A
parameter that one of the runs does not know yet (its method is older) may have its default in the other. A case that
stands in several experiments of a run is matched within each, and with what is left over where one is missing.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import PurePath
from typing import Any

from shadowbench.rows import ResultRow, RunRecord

SETTINGS = ("light", "camera", "width", "height", "pixel_samples", "layers", "moving", "device", "threads")
"""What is measured, beside scene, method and their parameters."""

Pair = tuple[ResultRow | None, ResultRow | None]
"""The case's row in either run, ``None`` where it has none; never two of them."""


def matched(
    a: Sequence[ResultRow], b: Sequence[ResultRow], run_a: RunRecord | None = None, run_b: RunRecord | None = None
) -> list[Pair]:
    """Return all cases of two runs: those of ``a`` in its order, each with its match, then what only ``b`` has.

    Args:
        a, b: The runs' rows.
        run_a, run_b: The runs, for their methods' defaults.
    """
    known_a, known_b = _known_parameters(a), _known_parameters(b)
    waiting: dict[str, list[ResultRow]] = {}
    for row in b:
        waiting.setdefault(_measured(row, known_a, run_b), []).append(row)
    keys = [_measured(row, known_b, run_a) for row in a]
    partners: dict[int, ResultRow] = {}
    for same_experiment in (True, False):
        for place, (key, row) in enumerate(zip(keys, a, strict=True)):
            left = waiting.get(key, [])
            partner = next((o for o in left if not same_experiment or o.experiment == row.experiment), None)
            if place not in partners and partner is not None:
                partners[place] = partner
                left.remove(partner)
    alone = {id(row) for rows in waiting.values() for row in rows}
    return [
        *((row, partners.get(place)) for place, row in enumerate(a)),
        *((None, row) for row in b if id(row) in alone),
    ]


def _known_parameters(rows: Sequence[ResultRow]) -> dict[str, set[str]]:
    known: dict[str, set[str]] = {}
    for row in rows:
        known.setdefault(row.method, set()).update(row.method_parameters)
    return known


def _measured(row: ResultRow, known_to_other: Mapping[str, set[str]], run: RunRecord | None) -> str:
    """Return what a row measures, as text that is equal for equal cases."""
    known = known_to_other.get(row.method)
    defaults = run.method_defaults.get(row.method, {}) if run is not None else {}
    parameters = {
        name: value
        for name, value in row.method_parameters.items()
        if known is None or name in known or name not in defaults or defaults[name] != value
    }
    scene = {name: _portable(value) for name, value in row.scene_parameters.items()}
    settings = [getattr(row, name) for name in SETTINGS]
    return json.dumps([row.scene, scene, row.method, parameters, settings], sort_keys=True, default=str)


def _portable(value: Any) -> Any:
    return PurePath(value).name if isinstance(value, str) and "/" in value else value
