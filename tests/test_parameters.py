"""Declared parameters: what they accept, and what a user reads when they do not."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal

import pytest
from pydantic import ValidationError, model_validator

from shadowbench.errors import ParameterError, PluginError, SceneError
from shadowbench.parameters import ParameterModel, describe_parameters, parameter, parse_parameters


class _Parameters(ParameterModel):
    triangles: int = parameter(10, unit="triangles", help="How many.", ge=1, le=100)
    bias: float = parameter(0.5, unit="texels", help="How far.", ge=0.0, lt=2.0)
    width: float = parameter(1.0, unit="1", help="Anything positive.", gt=0.0)
    filter: Literal["box", "gauss"] = parameter("box", unit="1", help="Which one.")
    ground: bool = parameter(True, unit="1", help="Whether.")


class _Needy(ParameterModel):
    path: Path = parameter(unit="1", help="Which file.")
    up: str = parameter("y", unit="1", help="Which axis.")


def _message(model: type[ParameterModel], values: dict[str, Any]) -> str:
    with pytest.raises(ParameterError) as caught:
        parse_parameters(model, values, owner="method 'pcf'")
    assert "\n" not in str(caught.value)
    assert str(caught.value).startswith("method 'pcf'")
    return str(caught.value)


def test_text_from_a_command_line_becomes_values() -> None:
    values = {"triangles": "7", "bias": "1.5", "filter": "gauss", "ground": "false"}
    parsed = parse_parameters(_Parameters, values, owner="method 'pcf'")
    assert parsed == _Parameters(triangles=7, bias=1.5, filter="gauss", ground=False)


def test_parameters_cannot_be_changed_afterwards() -> None:
    with pytest.raises(ValidationError):
        _Parameters().triangles = 3


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"triangels": 5}, ["no parameter 'triangels'", "did you mean 'triangles'?"]),
        ({"qqqq": 5}, ["no parameter 'qqqq'", "known parameters: bias, filter, ground, triangles, width"]),
        ({"triangles": 0}, ["'triangles' = 0", "greater than or equal to 1"]),
        ({"triangles": "101"}, ["'triangles' = '101'", "less than or equal to 100"]),
        ({"triangles": "many"}, ["'triangles' = 'many'", "integer"]),
        ({"triangles": 2.5}, ["'triangles' = 2.5", "integer"]),
        ({"bias": 2.0}, ["'bias' = 2.0", "less than 2"]),
        ({"bias": "nan"}, ["'bias' = 'nan'", "finite"]),
        ({"width": float("inf")}, ["'width'", "finite"]),
        ({"filter": "bx"}, ["'filter' = 'bx'", "'box' or 'gauss'"]),
        ({"ground": "perhaps"}, ["'ground' = 'perhaps'", "boolean"]),
    ],
)
def test_a_wrong_value_or_name_is_one_line_that_says_what_would_be_right(
    values: dict[str, Any], words: list[str]
) -> None:
    message = _message(_Parameters, values)
    for word in words:
        assert word in message


def test_a_required_parameter_is_asked_for() -> None:
    assert _message(_Needy, {}) == "method 'pcf' needs the parameter 'path'"


def test_a_misspelt_required_parameter_is_a_misspelling_not_a_lack() -> None:
    assert "no parameter 'pth'; did you mean 'path'?" in _message(_Needy, {"pth": "x"})


def test_a_check_over_several_parameters_speaks_for_itself() -> None:
    class Pair(ParameterModel):
        low: float = parameter(0.0, unit="1", help="Low.")
        high: float = parameter(1.0, unit="1", help="High.")

        @model_validator(mode="after")
        def _ordered(self) -> Pair:
            if self.low > self.high:
                raise ValueError("low must not exceed high")
            return self

    assert _message(Pair, {"low": 3}) == "method 'pcf': low must not exceed high"


def test_a_default_outside_its_own_range_is_found() -> None:
    class Wrong(ParameterModel):
        count: int = parameter(0, unit="1", help="Count.", ge=1)

    with pytest.raises(ValidationError):
        Wrong()


def test_a_parameter_error_is_both_a_scenes_and_a_plugins() -> None:
    assert issubclass(ParameterError, SceneError)
    assert issubclass(ParameterError, PluginError)


def test_descriptions_carry_default_unit_range_and_help() -> None:
    described = {d["name"]: d for d in describe_parameters(_Parameters)}
    assert list(described) == ["triangles", "bias", "width", "filter", "ground"]
    values = ("triangles", "10", "triangles", "[1, 100]", "How many.")
    assert described["triangles"] == dict(zip(("name", "default", "unit", "range", "help"), values, strict=True))
    assert described["bias"]["range"] == "[0.0, 2.0)"
    assert described["width"]["range"] == "(0.0, inf)"
    assert described["filter"]["range"] == "box | gauss"
    assert (described["ground"]["range"], described["ground"]["default"]) == ("true | false", "true")
    assert describe_parameters(_Needy)[0]["default"] == "required"
    assert describe_parameters(_Needy)[1]["range"] == ""
