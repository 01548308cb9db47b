"""Which columns a table has: from the experiment's own layouts, or chosen from its rows.

A layout's index may fail to tell two cases apart (a user sweeps something that the layout's author did not think of).
:func:`completed_index` then adds the columns that do: no case is ever hidden behind another.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from shadowbench.errors import ExperimentError, did_you_mean
from shadowbench.experiment import Printed, TableLayout
from shadowbench.rows import RATIOS, VERDICTS, ResultRow, RunRecord
from shadowbench.tables.columns import MEASURE, ROW_COLUMNS, Scalar, is_value_column, value_of

Layouts = Mapping[str, Sequence[TableLayout]]
"""Experiment -> its tables."""

SETTING = ("scene", "light", "camera", "size", "pixel_samples", "layers", "moving", "device", "threads")
"""What a case is besides its method; what is the same for all cases of a table stands in a note."""

DEFAULT_VALUES = (
    "build_ms",
    "shade_ms",
    "dynamic_frame_ms",
    "dynamic_frame_ratio",
    "dynamic_frame_verdict",
    "bytes_kept",
    "peak_rss_bytes",
    "failure_percent",
    "false_lit_percent",
    "false_shadow_percent",
    "acne_percent",
    "peter_panning_percent",
    "classified_percent",
    "rmse",
    "ssim",
    "flip",
    "leak_mean",
)
"""Values of the default table; those that no row holds are left out."""

_TELLING_APART = ("method", *SETTING, "comparison", "case")


def default_layout(rows: Sequence[ResultRow], title: str) -> TableLayout:
    """Return the layout of an experiment that has none: what varies, the method, costs and failures."""
    varying = [name for name in SETTING if len({_place(row, name) for row in rows}) > 1]
    held = [name for name in DEFAULT_VALUES if any(_is_held(row, name) for row in rows)]
    return TableLayout(title, (*varying, "method"), tuple(held) or DEFAULT_VALUES[:1])


def _is_held(row: ResultRow, name: str) -> bool:
    """Return whether a row has a value; a ratio, if it was timed beside a case that it can be compared with."""
    if name in RATIOS or name in VERDICTS:
        return row.baseline_case not in ("", row.case_key)
    return getattr(row, name) is not None


def layouts_of(run: RunRecord) -> dict[str, list[TableLayout]]:
    """Return the layouts that a run's record holds.

    Raises:
        ExperimentError: A stored layout is not one.
    """
    return {
        str(definition.get("name", "")): [_layout_from(stored) for stored in definition.get("tables", ())]
        for definition in run.definitions
    }


def _layout_from(stored: Mapping[str, Any]) -> TableLayout:
    try:
        return TableLayout(
            str(stored["title"]),
            tuple(stored["index"]),
            tuple(stored["values"]),
            stored.get("columns"),
            dict(stored.get("where", {})),
            tuple(Printed(dict(each["where"]), dict(each["values"])) for each in stored.get("printed", ())),
        )
    except (KeyError, TypeError, ValueError) as error:
        raise ExperimentError(f"a stored table layout cannot be used: {error!r}") from error


def check_layout(layout: TableLayout) -> None:
    """Refuse a layout that no row can fill.

    Raises:
        ExperimentError: There is no value, or one is no column that rows have, or they cannot be spread out so.
    """
    if not layout.values:
        raise ExperimentError(f"table '{layout.title}': needs at least one value")
    for name in layout.values:
        if not is_value_column(name):
            known = (*ROW_COLUMNS, "stages.NAME", "counters.NAME", "kept.NAME")
            raise ExperimentError(
                f"table '{layout.title}': no value is called '{name}'; {did_you_mean(name, known, noun='value')}"
            )
    if layout.columns == MEASURE:
        raise ExperimentError(f"table '{layout.title}': '{MEASURE}' may stand in its index, not in its columns")


def completed_index(
    layout: TableLayout, rows: Sequence[ResultRow], value: Callable[[ResultRow, str], Scalar]
) -> list[str]:
    """Return the layout's index, and after it the columns without which two cases would share a place.

    Args:
        layout: The layout.
        rows: The table's rows.
        value: A row's value in an index column, labels included.
    """
    index = list(layout.index)
    pivot = [layout.columns] if layout.columns else []
    for name in _TELLING_APART:
        places: dict[tuple[Scalar, ...], set[Scalar]] = {}
        shared = False
        for row in rows:
            place = tuple(value(row, column) for column in (*index, *pivot) if column != MEASURE)
            shared = shared or place in places
            places.setdefault(place, set()).add(value(row, name))
        if not shared:
            break
        if name not in (*index, *pivot) and any(len(found) > 1 for found in places.values()):
            index.append(name)
    return index


def _place(row: ResultRow, name: str) -> Scalar | tuple[Scalar, str]:
    """Return what tells settings apart: a scene is its name and its parameters."""
    return (row.scene, repr(sorted(row.scene_parameters.items()))) if name == "scene" else value_of(row, name)
