"""Cases of two runs are matched by what they measure, and none is matched twice."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from shadowbench.rows import ResultRow, RunRecord
from shadowbench.tables.matching import matched

MakeRow = Callable[..., ResultRow]
MakeRun = Callable[..., RunRecord]


def test_keys_machines_code_and_order_do_not_matter(make_row: MakeRow) -> None:
    a = [make_row(method=name, machine="one", code_version="1") for name in ("pcf", "esm", "vsm")]
    b = [make_row(method=name, machine="other", code_version="2") for name in ("vsm", "pcf", "csm")]
    assert matched(a, b) == [(a[0], b[1]), (a[1], None), (a[2], b[0]), (None, b[2])]


@pytest.mark.parametrize(
    "change",
    [
        *({name: "another"} for name in ("scene", "light", "camera", "moving", "method", "device")),
        *({name: 7} for name in ("width", "height", "pixel_samples", "layers", "threads")),
        {"scene_parameters": {"triangles": 2}},
        {"method_parameters": {"resolution": 2}},
    ],
)
def test_whatever_is_measured_matters(make_row: MakeRow, change: dict[str, Any]) -> None:
    given = {"scene_parameters": {"triangles": 1}, "method_parameters": {"resolution": 1}}
    a, b = make_row(**given), make_row(**(given | change))
    assert matched([a], [b]) == [(a, None), (None, b)]


def test_a_mesh_file_counts_by_its_name(make_row: MakeRow) -> None:
    a, b, other = (
        make_row(scene_parameters={"path": path}) for path in ("/home/me/cow.ply", "data/cow.ply", "data/pig.ply")
    )
    assert matched([a], [other, b]) == [(a, b), (None, other)]


def test_a_parameter_that_the_older_method_lacks_may_have_its_default(make_row: MakeRow, make_run: MakeRun) -> None:
    old = [make_row(method_parameters={"resolution": 512}), make_row(method_parameters={"resolution": 1024})]
    new = [
        make_row(method_parameters={"resolution": 512, "bias": 0.0}),
        make_row(method_parameters={"resolution": 1024, "bias": 0.5}),
    ]
    run = make_run(method_defaults={"pcf": {"resolution": 256, "bias": 0.0}})
    assert matched(old, new, None, run) == [(old[0], new[0]), (old[1], None), (None, new[1])]
    assert matched(new, old, run, None) == [(new[0], old[0]), (new[1], None), (None, old[1])]


def test_a_case_of_two_experiments_is_matched_within_each_and_then_with_what_is_left(make_row: MakeRow) -> None:
    a = [make_row(experiment=name) for name in ("quick", "tour")]
    b = [make_row(experiment=name) for name in ("tour", "mine", "quick")]
    assert matched(a, b) == [(a[0], b[2]), (a[1], b[0]), (None, b[1])]
    assert matched(a, b[1:]) == [(a[0], b[2]), (a[1], b[1])]
