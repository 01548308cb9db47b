"""A column's name -> its value in a row, its unit, and what its header says.

======================== =====================================================================================
name                     value
======================== =====================================================================================
``build_ms`` ...         a column of :class:`~shadowbench.rows.ResultRow`
``static_frame_fps``     frames per second: the inverse of ``static_frame_ms``; ``dynamic_frame_fps`` likewise
``dynamic_frame_ratio``  how many times as long as the comparison's first case it takes, by round; with
``dynamic_frame_verdict`` what that says. Likewise for ``build``, ``shade``, ``camera`` and ``static_frame``
``method``, ``scene``    a label: the name, and those parameters that tell the table's cases apart
``size``                 ``1024x768``
``case``                 the beginning of the case's key
``method.P``, ``scene.P``  a parameter of the method or of the scene
``P``                    the method's parameter or, if it has none of that name, the scene's
``stages.N``             the duration of a stage; ``counters.N`` and ``kept.N`` likewise
``measure``              in ``index`` only: each of the table's values gets a line of its own
======================== =====================================================================================

The same dotted names are the columns of :func:`shadowbench.load_results`.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable
from enum import StrEnum
from typing import Any

from shadowbench.rows import FRAME_RATES, LONG_FIELDS, LONG_UNITS, RATIOS, VERDICTS, ResultRow, column_unit
from shadowbench.statistics import median_over_processes
from shadowbench.tables.numbers import shown_unit

Scalar = str | int | float | bool | None

MEASURE = "measure"

ROW_COLUMNS = tuple(name for name in ResultRow.model_fields if name not in LONG_FIELDS)
"""The columns that a row has itself."""

_LONG_NUMBERS = ("stages", "counters", "kept")
_NAMES = {
    "bytes_kept": "kept",
    "peak_rss_bytes": "peak memory",
    "rmse": "RMSE",
    "edge_band_rmse": "edge band RMSE",
    "interior_rmse": "interior RMSE",
    "approximation_rmse": "approximation RMSE",
    "discretisation_rmse": "discretisation RMSE",
    "ssim": "SSIM",
    "flip": "FLIP",
    "leak_p99": "leak 99th percentile",
}


def value_of(row: ResultRow, name: str) -> Scalar:
    """Return a row's value under ``name``, ``None`` where it has none. Labels are :mod:`.labels`'s business."""
    if name in ROW_COLUMNS:
        return scalar(getattr(row, name))
    if name in FRAME_RATES:
        return _rate(getattr(row, FRAME_RATES[name]))
    if name in RATIOS or name in VERDICTS:
        return None  # takes another row: :mod:`.verdicts`'s business
    if name == "size":
        return f"{row.width}x{row.height}"
    if name == "case":
        return row.case_key[:12]
    owner, _, inner = name.partition(".")
    if inner and owner in _LONG_NUMBERS:
        return scalar(getattr(row, owner).get(inner))
    if inner and owner in ("method", "scene"):
        return scalar(getattr(row, f"{owner}_parameters").get(inner))
    return scalar(row.method_parameters.get(name, row.scene_parameters.get(name)))


def is_known(name: str, rows: Iterable[ResultRow]) -> bool:
    """Return whether ``name`` means something for any of ``rows``."""
    if is_value_column(name) or name in ("size", "case", MEASURE):
        return True
    return name.removeprefix("method.").removeprefix("scene.") in parameter_names(rows)


def is_value_column(name: str) -> bool:
    """Return whether ``name`` may stand among a layout's values."""
    owner, _, inner = name.partition(".")
    made = (*FRAME_RATES, *RATIOS, *VERDICTS)
    return name in ROW_COLUMNS or name in made or bool(inner and owner in _LONG_NUMBERS)


def parameter_names(rows: Iterable[ResultRow]) -> list[str]:
    """Return the names of all parameters of the rows' methods and scenes, in order of appearance."""
    return list(
        dict.fromkeys(name for row in rows for p in (row.method_parameters, row.scene_parameters) for name in p)
    )


def interval_of(row: ResultRow, name: str) -> tuple[float, float] | None:
    """Return the 95 % interval of a value, or ``None`` for one that has none."""
    if name in FRAME_RATES:
        durations = interval_of(row, FRAME_RATES[name])
        slowest, fastest = (None, None) if durations is None else (_rate(durations[1]), _rate(durations[0]))
        return None if slowest is None or fastest is None else (slowest, fastest)
    if name in row.samples and name.startswith("stages."):
        found = median_over_processes(row.samples[name], row.round_processes or None)
        return None if found.low is None or found.high is None else (found.low, found.high)
    low, high = getattr(row, f"{name}_low", None), getattr(row, f"{name}_high", None)
    return None if low is None or high is None else (low, high)


def _rate(duration: float | None) -> float | None:
    """Frames per second of a frame's duration [ms]."""
    return None if duration is None or duration <= 0.0 else 1.0e3 / duration


def unit_of(name: str) -> str:
    """Return the unit of a column's values, empty for text and parameters."""
    if name in ROW_COLUMNS:
        return column_unit(name)
    if name in FRAME_RATES:
        return "fps"
    if name in RATIOS:
        return "1"
    owner, _, inner = name.partition(".")
    return LONG_UNITS[owner] if inner and owner in _LONG_NUMBERS else ""


def header_text(name: str) -> str:
    """Return what a header says, without the unit: ``build_ms`` -> ``build``.

    A percentage and its count differ in the header's unit: ``false lit [%]``, ``false lit [count]``.
    """
    if name in _NAMES:
        return _NAMES[name]
    owner, _, inner = name.partition(".")
    if inner and owner in (*_LONG_NUMBERS, "method", "scene"):
        return inner
    if name in ROW_COLUMNS or name in FRAME_RATES:
        for ending in ("_ms", "_percent", "_count", "_fps"):
            name = name.removesuffix(ending)
    return name.replace("_", " ")


def header_unit(name: str) -> str:
    """Return the unit that a header shows, empty for none."""
    return "count" if name in ROW_COLUMNS and name.endswith("_count") else shown_unit(unit_of(name))


def finite(value: Any) -> Any:
    """Return a JSON value with ``None`` for every number in it that is not finite."""
    if isinstance(value, dict):
        return {key: finite(inner) for key, inner in value.items()}
    if isinstance(value, list):
        return [finite(inner) for inner in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def scalar(value: Any) -> Scalar:
    """Return what a cell can hold of ``value``: lists and mappings as JSON."""
    if isinstance(value, StrEnum):
        return value.value
    if value is None or isinstance(value, str | int | float):
        return value
    return json.dumps(value, default=str)
