"""Labels are short and tell cases apart."""

from __future__ import annotations

from typing import Any

from shadowbench.tables.labels import Labels


def test_only_parameters_that_vary_among_a_methods_cases_are_shown(make_row: Any) -> None:
    rows = [
        make_row(method="pcf", method_parameters={"resolution": 512, "kernel": 3, "bias": 0.5}),
        make_row(method="pcf", method_parameters={"resolution": 512, "kernel": 7, "bias": 0.5}),
        make_row(method="shadow-map", method_parameters={"resolution": 1024}),
        make_row(method="ray-traced"),
    ]
    labels = Labels("method", rows)
    assert [labels.of(row) for row in rows] == ["pcf(kernel=3)", "pcf(kernel=7)", "shadow-map", "ray-traced"]


def test_a_parameter_that_is_not_its_default_is_shown(make_row: Any) -> None:
    row = make_row(method_parameters={"kernel": 3, "bias": 0.5, "resolution": 512})
    defaults = {"pcf": {"kernel": 3, "bias": 0.25, "resolution": 512, "unheard_of": 1}}
    assert Labels("method", [row], defaults=defaults).of(row) == "pcf(bias=0.5)"


def test_a_parameter_with_its_own_column_is_left_out(make_row: Any) -> None:
    rows = [make_row(method_parameters={"kernel": k, "resolution": r}) for k in (3, 7) for r in (512, 1024)]
    for name in ("kernel", "method.kernel"):
        assert Labels("method", rows, with_columns=["scene", name]).of(rows[0]) == "pcf(resolution=512)"


def test_values_of_another_type_or_order_are_compared_as_json(make_row: Any) -> None:
    rows = [make_row(method_parameters={"on": value, "sizes": [1, {"a": 1}]}) for value in (True, 1, None)]
    labels = Labels("method", rows)
    assert [labels.of(row) for row in rows] == ["pcf(on=True)", "pcf(on=1)", "pcf(on=None)"]


def test_scenes_have_labels_of_their_own(make_row: Any) -> None:
    rows = [make_row(scene="random-triangles", scene_parameters={"triangles": n, "seed": 1}) for n in (1000, 10000)]
    assert Labels("scene", rows).of(rows[1]) == "random-triangles(triangles=10000)"
