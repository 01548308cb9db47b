"""Times of two runs: what is declared, and what a machine that was slower as a whole does to it."""

from __future__ import annotations

import random
from collections.abc import Callable
from itertools import pairwise
from statistics import median
from typing import Any

import pytest

from shadowbench.rows import ResultRow
from shadowbench.statistics import Verdict
from shadowbench.tables.changed_times import changed_times, not_comparable

MakeRow = Callable[..., ResultRow]

ROUNDS = 30


@pytest.fixture
def run_of(make_row: MakeRow) -> Callable[..., list[ResultRow]]:
    """Return a function that measures three cases in simulated rounds."""

    def measure(
        seed: int, *, slower: float = 1.0, machine: Callable[[int], float] = lambda _: 1.0, changed: bool = True
    ) -> list[ResultRow]:
        """Measure ``first``, ``second`` and ``third``; the last one's shade takes ``slower`` times as long.

        Args:
            seed: Of the noise, 1 %.
            slower: What an edit of ``third`` did.
            machine: What the machine does to a round.
            changed: Whether ``third`` has another key in each run.
        """
        noise = random.Random(seed)

        def samples(duration: float) -> list[float]:
            return [duration * machine(i) * noise.lognormvariate(0.0, 0.01) for i in range(ROUNDS)]

        camera = samples(5.0)
        return [
            make_row(
                method=name,
                case_key=f"{name}{seed if changed and name == 'third' else ''}",
                quality_key=f"{name}{seed if changed and name == 'third' else ''}",
                machine="one",
                comparison=f"run {seed}",
                samples={
                    "build": samples(3.0),
                    "shade": samples(7.0 * (slower if name == "third" else 1.0)),
                    "camera": camera,
                },
            )
            for name in ("first", "second", "third")
        ]

    return measure


RunOf = Callable[..., list[ResultRow]]


def _verdicts(a: list[ResultRow], b: list[ResultRow], threshold: float = 0.0) -> list[list[str]]:
    found = changed_times(list(zip(a, b, strict=True)), threshold).by_place
    return [[time.verdict.value for time in found[place]] for place in range(len(a))]


NONE = "no difference shown"


def test_an_edit_that_costs_five_percent_is_found_in_its_part_and_direction(run_of: RunOf) -> None:
    before, after = run_of(1), run_of(2, slower=1.05)
    assert _verdicts(before, after) == [[NONE, NONE], [NONE, NONE], [NONE, "slower"]]
    assert _verdicts(after, before) == [[NONE, NONE], [NONE, NONE], [NONE, "faster"]]
    change = changed_times(list(zip(before, after, strict=True)), 0.0).by_place[2][1]
    assert change.ratio.estimate == pytest.approx(1.05, rel=0.02)
    assert change.ratio.low is not None
    assert change.ratio.high is not None
    assert 1.0 < change.ratio.low < 1.05 < change.ratio.high


def test_less_than_the_threshold_is_no_difference(run_of: RunOf) -> None:
    before, after = run_of(1), run_of(2, slower=1.05)
    assert _verdicts(before, after, 0.1) == [[NONE, NONE]] * 3


@pytest.mark.parametrize("direction", [1.1, 1 / 1.1])
def test_a_machine_that_is_slower_as_a_whole_makes_no_case_slower(run_of: RunOf, direction: float) -> None:
    before, after = run_of(1), run_of(2, machine=lambda _: direction)
    assert _verdicts(before, after) == [[NONE, NONE]] * 3
    found = changed_times(list(zip(before, after, strict=True)), 0.0)
    assert median(found.drift) == pytest.approx(direction, rel=0.01)
    assert ("longer" if direction > 1.0 else "shorter") in found.note()


def test_what_disturbs_the_unchanged_cases_makes_no_other_case_faster(run_of: RunOf) -> None:
    before, after = run_of(1), run_of(2)
    for row in after[:2]:
        for name in ("build", "shade"):
            row.samples[name] = [1.3 * duration for duration in row.samples[name]]
    assert _verdicts(before, after)[2] == [NONE, NONE]


def test_a_slower_case_is_found_on_a_machine_that_is_slower_now_and_then(run_of: RunOf) -> None:
    before = run_of(1, machine=lambda i: 1.4 if i % 3 == 0 else 1.0)
    after = run_of(2, slower=1.5, machine=lambda i: 1.4 if i % 5 == 0 else 1.0)
    assert _verdicts(before, after)[2] == [NONE, "slower"]


def test_without_anything_unchanged_durations_are_compared_as_such(make_row: MakeRow) -> None:
    rows = [
        make_row(samples={"build": [3.0 * f + i * 0.01 for i in range(9)], "shade": [0.01] * 9}) for f in (1.0, 2.0)
    ]
    found = changed_times([(rows[0], rows[1])], 0.02)
    assert [(time.name, time.verdict) for time in found.by_place[0]] == [("build", Verdict.SLOWER)], (
        "what is shorter than a twentieth of a millisecond is not compared"
    )
    assert found.note() == ""


def test_a_case_that_left_its_rounds_early_is_no_measure_of_the_others(run_of: RunOf) -> None:
    before, after = run_of(1), run_of(2)
    before[0].samples["shade"] = before[0].samples["shade"][:7]
    before[0].samples["build"] = before[0].samples["build"][:7]
    assert _verdicts(before, after)[2] == [NONE, NONE]


def test_twenty_runs_of_the_same_code_show_next_to_no_difference(run_of: RunOf) -> None:
    runs = [run_of(seed, machine=lambda i, seed=seed: 1.0 + 0.05 * (seed % 3), changed=False) for seed in range(20)]
    declared = [verdict for a, b in pairwise(runs) for verdicts in _verdicts(a, b) for verdict in verdicts]
    assert sum(verdict != NONE for verdict in declared) <= 0.05 * len(declared)


@pytest.mark.parametrize(
    ("change", "why"),
    [
        ({"machine": "two"}, "measured on another machine"),
        ({"samples": {}}, "no samples are kept"),
        ({"samples": {"build": [0.001], "shade": [0.002]}}, "shorter than 0.05 ms"),
        ({}, ""),
    ],
)
def test_times_are_compared_within_one_machine_and_where_there_are_any(
    make_row: MakeRow, change: dict[str, Any], why: str
) -> None:
    given = {"machine": "one", "samples": {"build": [0.001], "shade": [1.0]}}
    a = make_row(**(given | ({} if "machine" in change else change)))
    assert not_comparable(a, make_row(**(given | change))) == why
