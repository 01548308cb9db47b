"""Values that several tables of an experiment file hold: names, columns, conditions, and lists of them.

A key takes one value or a list, so every value is made a list first. Messages are those of
:mod:`shadowbench.experiment_file`, which says in which file and line.
"""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import AfterValidator, BeforeValidator, Field, PlainValidator

from shadowbench.choices import Scalar
from shadowbench.errors import did_you_mean
from shadowbench.rows import FRAME_RATES, LONG_FIELDS, RATIOS, VERDICTS, ResultRow


def as_list(value: Any) -> Any:
    """Return a list of one value, or the list that it is."""
    return value if isinstance(value, list) else [value]


def name_of(value: Any) -> str:
    """Return a name that is not empty."""
    if not isinstance(value, str) or not value.strip():
        raise ValueError(f"expected a name, not {value!r}")
    return value


def value_column(value: Any) -> str:
    """Return the name of a value that a table can show."""
    name = name_of(value)
    known = (*ResultRow.model_fields, *FRAME_RATES, *RATIOS, *VERDICTS)
    if name not in known and name.partition(".")[0] not in LONG_FIELDS:
        raise ValueError(f"no column is called '{name}'; {did_you_mean(name, known, noun='column')}")
    return name


def without_repeats(values: list[Any]) -> list[Any]:
    """Return the list, in which nothing may stand twice."""
    for index, value in enumerate(values):
        if value in values[:index]:
            raise ValueError(f"'{value}' is listed twice")
    return values


def condition_of(value: Any) -> Scalar:
    """Return what a case's value must equal."""
    if not isinstance(value, Scalar):
        raise ValueError(f"a condition is a number, a text, true or false, not {value!r}")  # noqa: TRY004 - pydantic's
    return value


def _conditions(value: Any) -> Any:
    return [condition_of(each) for each in value] if isinstance(value, list) else condition_of(value)


LIST_RULES = (BeforeValidator(as_list), AfterValidator(without_repeats), Field(min_length=1))

Name = Annotated[str, PlainValidator(name_of)]
Names = Annotated[list[Name], *LIST_RULES]
Condition = Annotated[Scalar, PlainValidator(condition_of)]
Conditions = Annotated[Scalar | list[Scalar], PlainValidator(_conditions)]
ValueColumn = Annotated[str, PlainValidator(value_column)]
ValueColumns = Annotated[list[ValueColumn], *LIST_RULES]
