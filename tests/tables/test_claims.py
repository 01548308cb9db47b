"""Claims answered from rows: groups, verdicts, and why something stays open."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Callable
from dataclasses import asdict
from typing import Any

import pytest
from rich.console import Console

from shadowbench.claim import Claim, Test
from shadowbench.errors import ExperimentError, UsageError
from shadowbench.rows import Outcome, ResultRow
from shadowbench.tables.claims import ClaimAnswer, Verdict, answer_claims, answers_of
from shadowbench.tables.claims_text import CLAIM_FORMATS, render_claims, tally

HOLDS, FAILS, OPEN = Verdict.HOLDS, Verdict.DOES_NOT_HOLD, Verdict.UNDECIDED

MakeRow = Callable[..., ResultRow]


def _claim(*tests: Test, **fields: Any) -> Claim:
    return Claim(**({"name": "c", "statement": "It is so.", "source": "", "tests": tests} | fields))


def _answer(rows: list[ResultRow], *tests: Test, **options: Any) -> ClaimAnswer:
    (answer,) = answers_of("quick", [_claim(*tests)], rows, **options)
    return answer


def _maps(make_row: MakeRow, **values: dict[int, Any]) -> list[ResultRow]:
    """Rows of methods over resolutions, with a value of failure_percent."""
    return [
        make_row(method=method, method_parameters={"resolution": r, "kernel": 3}, failure_percent=value)
        for method, by_resolution in values.items()
        for r, value in by_resolution.items()
    ]


LESS = Test("failure_percent", "less than", of={"method": "esm"}, than={"method": "vsm"}, each=("resolution",))


def test_a_claim_holds_in_every_group_or_not_at_all(make_row: MakeRow) -> None:
    rows = _maps(make_row, esm={512: 2.0, 1024: 1.0}, vsm={512: 3.0, 1024: 1.5})
    answer = _answer(rows, LESS)
    assert answer.verdict is HOLDS
    assert set(answer.case_keys) == {row.case_key for row in rows}
    assert [finding.group for finding in answer.findings] == ["resolution 512", "resolution 1024"]
    assert answer.findings[0].value == pytest.approx(2.0 / 3.0)
    worse = _answer(_maps(make_row, esm={512: 2.0, 1024: 1.0}, vsm={512: 3.0, 1024: 0.5}), LESS)
    assert worse.verdict is FAILS
    assert worse.evidence == "fails in 1 of 2 comparisons: resolution 1024: 1.00 % against 0.50 %, ratio 2"


def test_all_tests_of_a_claim_must_hold(make_row: MakeRow) -> None:
    rows = _maps(make_row, esm={512: 2.0}, vsm={512: 3.0})
    assert _answer(rows, LESS, Test("failure_percent", "at most", number=2.5, each=("method",))).verdict is FAILS
    assert _answer(rows, LESS, Test("failure_percent", "at most", number=3.0, each=("method",))).verdict is HOLDS


def test_scenes_lights_cameras_and_sizes_are_groups_of_themselves(make_row: MakeRow) -> None:
    rows = [
        make_row(method=method, failure_percent=value, scene_parameters={"n": n}, camera=camera, width=width)
        for method, value in (("esm", 1.0), ("vsm", 2.0))
        for n in (1, 2)
        for camera in ("near", "far")
        for width in (64, 128)
    ]
    answer = _answer(rows, Test("failure_percent", "less than", of={"method": "esm"}, than={"method": "vsm"}))
    assert answer.verdict is HOLDS
    assert len(answer.findings) == 8
    assert answer.findings[0].group == "bunny(n=1), camera near, size 64x48"


def test_what_is_compared_does_not_split_the_groups(make_row: MakeRow) -> None:
    rows = [make_row(scene_parameters={"n": n, "seed": 1}, counters={"nodes": n * 2}) for n in (1, 2, 4)]
    sweep = Test("counters.nodes", "growing", over="scene.n")
    assert _answer(rows, sweep).evidence == "2, 4, 8 at n 1, 2, 4"
    ends = Test("counters.nodes", "at least", of={"scene.n": 4}, than={"scene.n": 1}, times=4.0)
    assert _answer(rows, ends).verdict is HOLDS


def test_each_part_of_one_side_meets_each_of_the_other(make_row: MakeRow) -> None:
    rows = _maps(make_row, esm={512: 1.0}, vsm={512: 2.0}, csm={512: 3.0})
    test = Test("failure_percent", "less than", of={"method": "esm"}, than={"method": ["vsm", "csm"]}, each=("method",))
    answer = _answer(rows, test)
    assert answer.verdict is HOLDS
    assert [finding.group for finding in answer.findings] == ["against vsm", "against csm"]


def test_two_values_of_one_case_are_compared(make_row: MakeRow) -> None:
    rows = [make_row(kept={"map": 8, "mask": 2}, bytes_kept=10)]
    assert _answer(rows, Test("kept.map", "more than", than_value="kept.mask")).verdict is HOLDS
    share = _answer(rows, Test("kept.mask", "at most", per="bytes_kept", number=0.2))
    assert (share.verdict, share.findings[0].value) == (HOLDS, 0.2)


def test_a_ratio_may_run_over_a_sweep(make_row: MakeRow) -> None:
    rows = _maps(make_row, esm={1: 2.0, 2: 3.0, 4: 4.0}, vsm={1: 2.0, 2: 2.0, 4: 2.0})
    grows = Test("failure_percent", "growing", of={"method": "esm"}, relative_to={"method": "vsm"}, over="resolution")
    answer = _answer(rows, grows)
    assert (answer.verdict, answer.evidence) == (HOLDS, "1.000, 1.500, 2.000 at resolution 1, 2, 4")
    crosses = Test(
        "failure_percent", "crossing upwards", of={"method": "vsm"}, than={"method": "esm"}, over="resolution"
    )
    assert _answer(rows, crosses).verdict is FAILS


def test_texts_are_equal_or_not(make_row: MakeRow) -> None:
    same = Test("visibility_digest", "equal to", of={"method": "afsm"}, than={"method": "ray-traced"})
    rows = [make_row(method=method, visibility_digest="d") for method in ("afsm", "ray-traced")]
    assert _answer(rows, same).verdict is HOLDS
    rows[1] = make_row(method="ray-traced", visibility_digest="e")
    assert _answer(rows, same).verdict is FAILS


@pytest.mark.parametrize(
    ("changes", "why"),
    [
        ({"method": "pcf"}, "no case has method vsm"),
        ({"outcome": Outcome.CRASH, "reason": "signal 11"}, "vsm ended as crash: signal 11"),
        ({"outcome": Outcome.SKIPPED, "reason": "not installed"}, "vsm ended as skipped: not installed"),
        ({"failure_percent": None}, "vsm has no number under failure_percent"),
        ({"method_parameters": {"resolution": 1024}}, "no case with vsm"),
    ],
)
def test_what_is_missing_leaves_a_claim_open(make_row: MakeRow, changes: dict[str, Any], why: str) -> None:
    rows = _maps(make_row, esm={512: 1.0})
    given = {"method": "vsm", "method_parameters": {"resolution": 512}, "failure_percent": 2.0}
    answer = _answer([*rows, make_row(**(given | changes))], LESS)
    assert answer.verdict is OPEN
    assert why in answer.evidence


def test_a_failure_elsewhere_decides_whatever_is_missing(make_row: MakeRow) -> None:
    rows = _maps(make_row, esm={512: 3.0, 1024: 1.0}, vsm={512: 2.0})
    assert _answer(rows, LESS, case_count=9).verdict is FAILS


def test_of_a_partial_run_nothing_is_said_to_hold(make_row: MakeRow) -> None:
    answer = _answer(_maps(make_row, esm={512: 1.0}, vsm={512: 2.0}), LESS, case_count=4)
    assert answer.verdict is OPEN
    assert answer.evidence.startswith("2 of 4 cases are measured; so far it holds: ")
    assert _answer([], LESS, case_count=4).evidence == "no case has been measured"


def test_several_cases_for_one_place_say_what_tells_them_apart(make_row: MakeRow) -> None:
    rows = _maps(make_row, esm={512: 1.0, 1024: 1.0}, vsm={512: 2.0, 1024: 2.0})
    test = Test("failure_percent", "less than", of={"method": "esm"}, than={"method": "vsm"})
    assert _answer(rows, test).evidence == "2 cases for one place of 'of'; 'each' must name resolution"


def test_names_that_no_case_has_are_told_with_the_nearest(make_row: MakeRow) -> None:
    rows = _maps(make_row, esm={512: 1.0})
    answer = _answer(rows, Test("failure_percent", "at most", of={"resolutoin": 512}, number=1.0))
    assert answer.evidence == "no case has 'resolutoin'; did you mean 'resolution'?"


def test_a_sweep_over_texts_or_one_value_is_open(make_row: MakeRow) -> None:
    rows = _maps(make_row, esm={512: 1.0})
    assert "has one value only" in _answer(rows, Test("failure_percent", "growing", over="resolution")).evidence
    assert "'method' is no number" in _answer(rows, Test("failure_percent", "growing", over="method")).evidence


# Times


def _timed(make_row: MakeRow, method: str, shade: list[float], **fields: Any) -> ResultRow:
    ordered = sorted(shade)
    return make_row(
        method=method,
        comparison="together",
        samples={"build": [0.0] * len(shade), "shade": shade},
        shade_ms=ordered[len(shade) // 2],
        shade_ms_low=ordered[0],
        shade_ms_high=ordered[-1],
        **fields,
    )


FASTER = Test("shade_ms", "less than", of={"method": "esm"}, than={"method": "vsm"}, each=("resolution",))


def test_times_decide_by_the_ratio_within_each_round(make_row: MakeRow) -> None:
    drifting = [float(r) for r in range(10, 20)]
    rows = [
        _timed(make_row, "esm", drifting),
        _timed(make_row, "vsm", [1.1 * x for x in drifting]),
    ]
    answer = _answer(rows, FASTER)
    assert answer.verdict is HOLDS, "though their own intervals overlap"
    assert "ratio 0.909" in answer.evidence
    rows[1] = _timed(make_row, "vsm", drifting[::-1])
    assert _answer(rows, FASTER).verdict is OPEN


def test_one_failure_among_many_comparisons_of_times_is_put_down_to_chance(make_row: MakeRow) -> None:
    """Of ten groups nine are alike; in one, six rounds of six go the other way, which alone would count (1 in 32)."""
    rows = []
    for resolution in range(1, 11):
        slower = [1.2] * 6 if resolution == 1 else [0.9, 1.1] * 3
        rows += [
            _timed(make_row, "esm", slower, method_parameters={"resolution": resolution}),
            _timed(make_row, "vsm", [1.0] * 6, method_parameters={"resolution": resolution}),
        ]
    assert _answer(rows[:2], FASTER).verdict is FAILS
    answer = _answer(rows, FASTER)
    assert answer.verdict is OPEN
    assert "no failure beyond chance among 10 comparisons" in answer.findings[0].evidence


# A run's claims, and how they are written


def _run(make_run: Any, *claims: Claim, **fields: Any) -> Any:
    definition = {"name": "quick", "source": "Somebody", "case_count": 2, "claims": [asdict(c) for c in claims]}
    return make_run(definitions=[json.loads(json.dumps(definition | fields)), {"name": "old", "title": "no claims"}])


def test_a_runs_record_holds_its_claims(make_row: MakeRow, make_run: Any) -> None:
    rows = _maps(make_row, esm={512: 1.0}, vsm={512: 2.0})
    first, second = answer_claims(_run(make_run, _claim(LESS), _claim(LESS, source="Me", name="d")), rows)
    assert (first.name, first.experiment, first.source, first.verdict) == ("c", "quick", "Somebody", HOLDS)
    assert (second.name, second.source) == ("d", "Me")
    assert answer_claims(make_run(), rows) == ()
    with pytest.raises(ExperimentError, match="a stored claim cannot be used"):
        answer_claims(make_run(definitions=[{"name": "quick", "claims": [{"name": "c"}]}]), rows)


def test_rows_of_other_experiments_do_not_count(make_row: MakeRow, make_run: Any) -> None:
    rows = [row.model_copy(update={"experiment": "other"}) for row in _maps(make_row, esm={512: 1.0}, vsm={512: 2.0})]
    (answer,) = answer_claims(_run(make_run, _claim(LESS)), rows)
    assert answer.evidence == "no case has been measured"


def _written(answers: list[ClaimAnswer], form: str) -> str:
    written = render_claims(answers, form)
    if isinstance(written, str):
        return written
    console = Console(file=io.StringIO(), width=120)
    console.print(written)
    return console.file.getvalue()  # type: ignore[attr-defined]


def test_every_format_has_the_verdict_and_what_decides(make_row: MakeRow) -> None:
    answers = [_answer(_maps(make_row, esm={512: 1.0}, vsm={512: 2.0}), LESS)]
    for form in CLAIM_FORMATS:
        text = _written(answers, form)
        assert "holds" in text
        assert "It is so." in text
        assert "ratio 0.5" in text
    assert json.loads(_written(answers, "json"))[0]["findings"][0]["value"] == 0.5
    (line,) = csv.DictReader(io.StringIO(_written(answers, "csv")))
    assert (line["claim"], line["verdict"]) == ("c", "holds")
    with pytest.raises(UsageError, match="did you mean 'latex'"):
        render_claims(answers, "latx")


def test_hostile_words_stay_words(make_row: MakeRow, hostile: str) -> None:
    claim = _claim(LESS, statement=hostile, source=hostile)
    rows = [make_row(method="esm", outcome="crash", reason=hostile), make_row(method="vsm")]
    answers = answers_of(hostile, [claim], [row.model_copy(update={"experiment": hostile}) for row in rows])
    for form in CLAIM_FORMATS:
        text = _written(answers, form)
        assert "\x1b[31m" not in text
        assert "<script>" not in text or form in ("rich", "csv", "latex", "json")
    body = _written(answers, "latex").split(r"\midrule")[1].split(r"\bottomrule")[0]
    assert body.count(r" \\") == 1, "one line"
    assert len(list(csv.reader(io.StringIO(_written(answers, "csv"))))) == 2
    json.loads(_written(answers, "json"))


def test_the_tally_counts_verdicts(make_row: MakeRow) -> None:
    holds = _answer(_maps(make_row, esm={512: 1.0}, vsm={512: 2.0}), LESS)
    open_one = _answer([], LESS)
    assert tally([holds, holds, open_one]) == "2 hold, 1 is undecided"
    assert tally([]) == "no claims"
