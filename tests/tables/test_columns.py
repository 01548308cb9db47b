"""Names of columns and what they mean."""

from __future__ import annotations

from typing import Any

import pytest

from shadowbench.rows import ResultRow
from shadowbench.tables.columns import (
    ROW_COLUMNS,
    header_text,
    header_unit,
    interval_of,
    is_known,
    is_value_column,
    unit_of,
    value_of,
)


@pytest.fixture
def row(make_row: Any) -> ResultRow:
    row: ResultRow = make_row(
        method_parameters={"resolution": 512, "bias": 0.5, "kind": None},
        scene_parameters={"seed": 7, "bias": 9},
        triangles=1000,
        build_ms=1.5,
        build_ms_low=1.0,
        build_ms_high=2.0,
        warnings=["w"],
        stages={"BSP construction": 2.0},
        counters={"nodes.visited": 3},
        kept={"map": 4},
    )
    return row


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("build_ms", 1.5),
        ("shade_ms", None),
        ("outcome", "ok"),
        ("warnings", '["w"]'),
        ("size", "64x48"),
        ("resolution", 512),
        ("method.resolution", 512),
        ("scene.resolution", None),
        ("seed", 7),
        ("bias", 0.5),
        ("scene.bias", 9),
        ("kind", None),
        ("missing", None),
        ("stages.BSP construction", 2.0),
        ("counters.nodes.visited", 3),
        ("kept.map", 4),
        ("kept.other", None),
    ],
)
def test_a_name_finds_its_value(row: ResultRow, name: str, value: object) -> None:
    assert value_of(row, name) == value


@pytest.mark.parametrize(
    ("name", "heading", "unit"),
    [
        ("build_ms", "build", "ms"),
        ("false_lit_percent", "false lit", "%"),
        ("false_lit_count", "false lit", "count"),
        ("bytes_kept", "kept", "MiB"),
        ("peak_rss_bytes", "peak memory", "MiB"),
        ("rmse", "RMSE", ""),
        ("triangles", "triangles", ""),
        ("stages.BSP construction", "BSP construction", "ms"),
        ("counters.nodes visited", "nodes visited", ""),
        ("kept.shadow map", "shadow map", "MiB"),
        ("method.slope_bias", "slope_bias", ""),
        ("slope_bias", "slope bias", ""),
    ],
)
def test_a_heading_names_the_quantity_and_its_unit(name: str, heading: str, unit: str) -> None:
    assert (header_text(name), header_unit(name)) == (heading, unit)


def test_every_number_of_a_row_has_a_unit_or_is_a_setting() -> None:
    settings = {"width", "height", "pixel_samples", "layers", "threads"}
    for name, field in ResultRow.model_fields.items():
        if name in ROW_COLUMNS and field.annotation in (int, int | None, float | None) and name not in settings:
            assert unit_of(name), name


def test_intervals_belong_to_times_that_have_them(row: ResultRow) -> None:
    assert interval_of(row, "build_ms") == (1.0, 2.0)
    assert interval_of(row, "shade_ms") is None
    assert interval_of(row, "stages.BSP construction") is None


def test_names_that_mean_nothing_are_known_as_such(row: ResultRow) -> None:
    assert all(is_known(name, [row]) for name in ("build_ms", "size", "seed", "method.kind", "scene.seed", "measure"))
    assert not any(is_known(name, [row]) for name in ("sede", "method.sede", ""))
    assert all(is_value_column(name) for name in ("build_ms", "stages.x", "counters.a.b"))
    assert not any(is_value_column(name) for name in ("stages", "stages.", "stages.x"[:6], "samples.x", "resolution"))


def test_a_frame_rate_is_the_inverse_of_a_frame_and_its_interval_is_turned_round(make_row: Any) -> None:
    row = make_row(dynamic_frame_ms=20.0, dynamic_frame_ms_low=10.0, dynamic_frame_ms_high=40.0)
    assert value_of(row, "dynamic_frame_fps") == 50.0
    assert interval_of(row, "dynamic_frame_fps") == (25.0, 100.0)
    assert (unit_of("dynamic_frame_fps"), header_text("dynamic_frame_fps")) == ("fps", "dynamic frame")
    assert is_value_column("static_frame_fps")
    assert value_of(row, "static_frame_fps") is None
    assert interval_of(row, "static_frame_fps") is None
