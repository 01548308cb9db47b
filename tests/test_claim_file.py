"""Claims in experiment files: what they mean, and one line with file and line for all that is wrong with them."""

from __future__ import annotations

import json
from dataclasses import asdict

import pytest

from shadowbench import experiment
from shadowbench.claim import RELATIONS, Claim, Test, claim_from
from shadowbench.errors import ExperimentError

HEAD = """\
title = "Claims"
source = "Somebody 2008"

[[comparison]]
scene = "bunny"

"""

GOOD = (
    HEAD
    + """\
[[claim]]
name = "half-the-memory"
statement = "Half of
the memory."
source = "Somebody 2008, section 4"

[claim.test]
value = "bytes_kept"
of = {method = "esm"}
is = "equal to"
times = 0.5
than = {method = ["vsm", "csm"]}
each = "method"

[[claim]]
name = "slower"
statement = "Larger maps are slower."

[[claim.test]]
value = "dynamic_frame_ms"
is = "growing"
over = "resolution"
where = {light = "sun"}

[[claim.test]]
value = "stages.filter"
per = "shade_ms"
is = "growing as a power"
over = "resolution"
at_least = 1
at_most = 2.5
"""
).replace("Half of\nthe", "Half of the")


def test_a_claim_says_what_would_make_it_true() -> None:
    half, slower = experiment.parse(GOOD, name="claims").claims
    assert half == Claim(
        "half-the-memory",
        "Half of the memory.",
        "Somebody 2008, section 4",
        (
            Test(
                value="bytes_kept",
                relation="equal to",
                of={"method": "esm"},
                than={"method": ["vsm", "csm"]},
                times=0.5,
                each=("method",),
            ),
        ),
    )
    assert slower.source == ""
    assert [test.relation for test in slower.tests] == ["growing", "growing as a power"]
    assert (slower.tests[1].per, slower.tests[1].at_least, slower.tests[1].at_most) == ("shade_ms", 1, 2.5)


def test_a_claim_comes_back_from_a_runs_record() -> None:
    for claim in experiment.parse(GOOD, name="claims").claims:
        assert claim_from(json.loads(json.dumps(asdict(claim)))) == claim


@pytest.mark.parametrize(
    "stored",
    [{}, {"name": "n", "statement": "s", "tests": [{"value": "v", "relation": "is like"}]}, {"tests": [{"x": 1}]}],
)
def test_a_record_that_holds_no_claim_is_refused(stored: dict[str, object]) -> None:
    with pytest.raises(ExperimentError, match="a stored claim cannot be used"):
        claim_from(stored)


def _with_test(lines: str) -> str:
    return HEAD + f'[[claim]]\nname = "c"\nstatement = "It is so."\n[[claim.test]]\n{lines}'


ESM, VSM = 'of = {method = "esm"}', 'than = {method = "vsm"}'


@pytest.mark.parametrize(
    ("lines", "line", "message"),
    [
        (
            f'value = "bytes_kep"\n{ESM}\nis = "at most"\nnumber = 1',
            11,
            "no column is called 'bytes_kep'; did you mean 'bytes_kept'?",
        ),
        (
            f'value = "rmse"\n{ESM}\nis = "les than"\n{VSM}',
            13,
            "nothing is said with is = 'les than'; did you mean 'less than'?",
        ),
        (f'value = "rmse"\n{ESM}\nis = "less than"\n{VSM}\nover = "c"', 10, "'over' does not go with is = 'less than'"),
        (f'value = "rmse"\n{ESM}\nis = "less than"', 10, "needs 'than', the cases to compare with, or a 'number'"),
        (f'value = "rmse"\n{ESM}\nis = "less than"\n{VSM}\nnumber = 3', 10, "not both"),
        (
            f'value = "rmse"\n{ESM}\nis = "less than"\nnumber = 3\ntimes = 2',
            10,
            "'times' and 'than_value' go with 'than'",
        ),
        (
            f'value = "rmse"\n{ESM}\nis = "less than"\n{VSM}\nwithin = 0.1',
            10,
            "'within' does not go with is = 'less than'",
        ),
        ('value = "rmse"\nis = "growing"', 10, "needs 'over', the parameter or column of a sweep"),
        ('value = "rmse"\nis = "growing as a power"\nover = "c"', 10, "needs 'at_least' or 'at_most'"),
        ('value = "rmse"\nis = "crossing upwards"\nover = "c"', 10, "needs 'than', the cases that it crosses"),
        (f'value = "rmse"\n{ESM}\nis = "less than"\nthan = {{}}', 14, "'than' must not be empty"),
        (f'value = "rmse"\nfo = 1\nis = "less than"\n{VSM}', 12, "unknown key 'fo'; did you mean 'of'?"),
        (f'value = "rmse"\n{ESM}\nwas = "less than"\n{VSM}', 13, "unknown key 'was'"),
        (f'value = "rmse"\n{ESM}\n{VSM}', 10, "the key 'is' is missing in [[claim.test]]"),
        (f'value = "rmse"\n{ESM}\nis = "equal to"\n{VSM}\nwithin = 1.5', 15, "'within'"),
        (f'value = "rmse"\n{ESM}\nis = "less than"\n{VSM}\ntimes = -1', 15, "'times'"),
        (f'value = "rmse"\n{ESM}\nis = "less than"\nnumber = "3"', 14, "'number'"),
        (
            'value = "rmse"\nof = {method = [1, [2]]}\nis = "less than"\nnumber = 3',
            12,
            "a condition is a number, a text",
        ),
    ],
)
def test_a_wrong_test_is_refused_with_its_line(lines: str, line: int, message: str) -> None:
    with pytest.raises(ExperimentError) as refused:
        experiment.parse(_with_test(lines), name="c", file="c.toml")
    assert f"c.toml:{line}: " in str(refused.value)
    assert message in str(refused.value)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('[[claims]]\nname = "c"', "unknown key 'claims'; did you mean 'claim'?"),
        ('[claim]\nname = "c"', "write [[claim]], not [claim]"),
        ('[[claim]]\nname = "c"\nstatement = "s"', "the key 'test' is missing in [[claim]]"),
        ('[[claim]]\nname = "c"\nstatement = "s"\ntest = []', "'test' must not be empty"),
        ('[[claim]]\nname = "c d"\nstatement = "s"\ntest = []', "'name' may hold letters"),
        ('[[claim]]\nname = "c"\nstatement = " "\ntest = []', "expected a sentence"),
        ('[[claim]]\nname = "c"\nstatemen = " "\ntest = []', "did you mean 'statement'?"),
        (
            2 * '[[claim]]\nname = "c"\nstatement = "s"\ntest = {value = "rmse", is = "less than", number = 1}\n',
            "'c' is listed twice",
        ),
    ],
)
def test_a_wrong_claim_is_refused(text: str, message: str) -> None:
    with pytest.raises(ExperimentError) as refused:
        experiment.parse(HEAD + text, name="c", file="c.toml")
    assert message in str(refused.value)
    assert "c.toml:" in str(refused.value)


def test_every_word_of_the_language_is_documented() -> None:
    from shadowbench import claim

    assert claim.__doc__ is not None
    for relation in RELATIONS:
        assert f"``{relation}``" in claim.__doc__
    for name in Test.__dataclass_fields__:
        assert f"``{name}``" in claim.__doc__ or name == "relation"
