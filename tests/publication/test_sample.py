"""Which published cases are computed again."""

from __future__ import annotations

import itertools
from typing import Any

from stored_rows import some_row

from shadowbench.publication.sample import MOST_OF_AN_EXPERIMENT, sampled


def _row(key: str, **fields: Any) -> Any:
    given = {"case_key": key, "device": "cpu", "receivers": 1000, "triangles": 1000} | fields
    return some_row(**given)


def test_each_experiment_gives_cases_of_its_cheapest_view() -> None:
    rows = [
        _row("a", experiment="one", method="pcf", receivers=9000),
        _row("b", experiment="one", method="pcf", width=64),
        _row("c", experiment="two", method="esm"),
    ]
    assert [row.case_key for row in sampled(rows)] == ["b", "c"]


def test_every_technique_and_every_choice_by_a_word_is_there_once() -> None:
    rows = [
        _row("a", method="esm", method_parameters={"classification": "z-max", "kernel": 3}),
        _row("b", method="esm", method_parameters={"classification": "z-max", "kernel": 5}),
        _row("c", method="esm", method_parameters={"classification": "threshold", "kernel": 3}),
        _row("d", method="vsm", method_parameters={"kernel": 3}),
    ]
    assert [row.case_key for row in sampled(rows)] == ["a", "c", "d"]


def test_many_kinds_are_thinned_evenly_and_peers_and_large_scenes_left_out() -> None:
    many = [_row(f"{n:02}", method="m", method_parameters={"mode": f"m{n}"}) for n in range(20)]
    others = [
        _row("peer", method="embree"),
        _row("changing", method="n", changed_count=1),
        _row("large", method="o", triangles=4_000_000),
        _row("failed", method="p", outcome="error"),
    ]
    keys = [row.case_key for row in sampled([*others, *many])]
    assert len(keys) == MOST_OF_AN_EXPERIMENT
    assert keys[0] == "00"
    assert all(key.isdigit() for key in keys)
    gaps = {int(b) - int(a) for a, b in itertools.pairwise(keys)}
    assert gaps == {4}
