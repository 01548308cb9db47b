"""The shape of an experiment file, and the one-line message when a file does not have it.

Pydantic models mirror the TOML tables; a key takes one value or a list, so every value is made a list first. Only
:mod:`shadowbench.experiment` uses this module.
"""

from __future__ import annotations

import itertools
import math
import re
import tomllib
from collections.abc import Iterator, Mapping
from typing import Annotated, Any, Self, TypeVar

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    PlainValidator,
    ValidationError,
    model_validator,
)

from shadowbench.choices import (
    Choice,
    Scalar,
    choice_of_table,
    choice_of_text,
    layer_count_of,
    moving_of,
    pixel_sample_count_of,
    size_of,
    thread_count_of,
)
from shadowbench.claim_file import ClaimTable, TestTable
from shadowbench.errors import ExperimentError, did_you_mean
from shadowbench.toml_lines import line_numbers, line_of
from shadowbench.toml_values import LIST_RULES, Condition, Conditions, Name, Names, ValueColumns, without_repeats

T = TypeVar("T")


def _choice(value: Any) -> Choice:
    if isinstance(value, dict):
        return choice_of_table(value)
    if isinstance(value, str):
        return choice_of_text(value)
    raise ValueError(f"expected a name, or a table with a 'name', not {value!r}")


def _size(value: Any) -> tuple[int, int]:
    return size_of(value if isinstance(value, str) else repr(value))


def _numbers(value: Any) -> Any:
    if isinstance(value, list):
        return [_numbers(each) for each in value]
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise ValueError(f"a printed value is a finite number, not {value!r}")
    return float(value)


def _named_once(claims: list[ClaimTable]) -> list[ClaimTable]:
    without_repeats([claim.name for claim in claims])
    return claims


def _at(given: Mapping[str, T | list[T]], case: int) -> dict[str, T]:
    """Return each entry, or of a list its element for a case."""
    return {name: value[case] if isinstance(value, list) else value for name, value in given.items()}


Choices = Annotated[list[Annotated[Choice, PlainValidator(_choice)]], *LIST_RULES]
Sizes = Annotated[list[Annotated[tuple[int, int], PlainValidator(_size)]], *LIST_RULES]
PixelSampleCounts = Annotated[list[Annotated[int, PlainValidator(pixel_sample_count_of)]], *LIST_RULES]
LayerCounts = Annotated[list[Annotated[int, PlainValidator(layer_count_of)]], *LIST_RULES]
Movings = Annotated[list[Annotated[str, PlainValidator(moving_of)]], *LIST_RULES]
ThreadCounts = Annotated[list[Annotated[int, PlainValidator(thread_count_of)]], *LIST_RULES]
Numbers = Annotated[float | list[float], PlainValidator(_numbers)]


class ComparisonTable(BaseModel):
    """A ``[[comparison]]``; what is ``None`` was not said."""

    model_config = ConfigDict(extra="forbid")

    scene: Choices
    method: Choices | None = None
    light: Names | None = None
    camera: Names | None = None
    size: Sizes | None = None
    pixel_samples: PixelSampleCounts | None = None
    layers: LayerCounts | None = None
    moving: Movings | None = None
    threads: ThreadCounts | None = None


class PrintedTable(BaseModel):
    """A ``[[table.printed]]``: cases, and the numbers that a source prints for them.

    Conditions that are lists are read side by side, each position a case; a value is then a list too, or one for all.
    """

    model_config = ConfigDict(extra="forbid")

    where: dict[str, Conditions]
    values: Annotated[dict[str, Numbers], Field(min_length=1)]

    @model_validator(mode="after")
    def _lists_belong_together(self) -> Self:
        lengths = {len(listed) for listed in self.where.values() if isinstance(listed, list)}
        if len(lengths) > 1:
            raise ValueError("the lists in 'where' have different lengths")
        for name, numbers in self.values.items():
            if isinstance(numbers, list) and {len(numbers)} != lengths:
                wanted = f"not {lengths.pop()}" if lengths else "but 'where' has no list"
                raise ValueError(f"'{name}' lists {len(numbers)} printed values, {wanted}")
        return self

    def cases(self) -> Iterator[tuple[dict[str, Scalar], dict[str, float]]]:
        """Yield the conditions and the numbers of each case."""
        count = next((len(listed) for listed in self.where.values() if isinstance(listed, list)), 1)
        for case in range(count):
            yield _at(self.where, case), _at(self.values, case)


class LayoutTable(BaseModel):
    """A ``[[table]]``."""

    model_config = ConfigDict(extra="forbid")

    title: str
    index: Names
    values: ValueColumns
    columns: Name | None = None
    where: dict[str, Condition] = Field(default_factory=dict)
    printed: list[PrintedTable] = Field(default_factory=list)

    @model_validator(mode="after")
    def _printed_values_are_shown(self) -> Self:
        for name in (name for printed in self.printed for name in printed.values):
            if name not in self.values:
                raise ValueError(f"'{name}' is printed but not shown; {did_you_mean(name, self.values, noun='value')}")
        return self


class ExperimentFile(BaseModel):
    """The whole file."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)

    name: Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_.-]*$")] | None = None
    title: str
    source: str = ""
    description: str = ""
    budget: Annotated[float, Field(gt=0)] | None = None
    comparison: Annotated[list[ComparisonTable], Field(min_length=1)]
    table: list[LayoutTable] = Field(default_factory=list)
    claim: Annotated[list[ClaimTable], AfterValidator(_named_once)] = Field(default_factory=list)


def read(text: str, file: str) -> ExperimentFile:
    """Check a TOML text.

    Args:
        text: The file's content.
        file: For messages.

    Raises:
        ExperimentError: Names file and line.
    """
    try:
        content = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        found = re.match(r"(.*) \(at (?:line (\d+), column \d+|end of document)\)", str(error))
        message, number = found.groups() if found else (str(error), None)
        line = int(number) if number else text.rstrip().count("\n") + 1
        raise ExperimentError(f"not TOML: {message[:1].lower() + message[1:]}", file=file, line=line) from None
    try:
        return ExperimentFile.model_validate(content)
    except ValidationError as error:
        message, path = _first_error(error)
        raise ExperimentError(message, file=file, line=line_of(line_numbers(text), path)) from None


def _first_error(error: ValidationError) -> tuple[str, tuple[str | int, ...]]:
    """Return what is wrong first, in one line, and the path of keys and positions to it."""
    errors = error.errors(include_url=False)
    # a misspelt key is also a missing one; its spelling is what helps
    first = next((e for e in errors if e["type"] == "extra_forbidden"), errors[0])
    path = first["loc"]
    name = str(path[-1])
    # "[[comparison]]" where a single "[comparison]" was written: say so, rather than "should be a list"
    if first["type"] == "list_type" and isinstance(first["input"], dict):
        return f"'{name}' is a list of tables: write [[{name}]], not [{name}]", path
    match first["type"]:
        case "extra_forbidden":
            model = _model_at(path)
            known = (field.alias or key for key, field in model.model_fields.items())
            return f"unknown key '{name}'; {did_you_mean(name, known, noun='key')}", path
        case "missing":
            where = f" in [[{_table_at(path)}]]" if len(path) > 1 else ""
            return f"the key '{name}' is missing{where}", path
        case "too_short":
            return f"'{name}' must not be empty", path
        case "string_pattern_mismatch":
            return f"'{name}' may hold letters, digits, '-', '_' and '.', not '{first['input']}'", path
    message = first["msg"].removeprefix("Value error, ")
    if first["type"] == "value_error":
        return message, path
    return f"'{name}': {message[:1].lower() + message[1:]}", path


def _table_at(path: tuple[str | int, ...]) -> str:
    """Return the name of the table that holds a key, as TOML writes it; empty for the file itself."""
    return ".".join(str(key) for key, position in itertools.pairwise(path) if isinstance(position, int))


def _model_at(path: tuple[str | int, ...]) -> type[BaseModel]:
    tables: dict[str, type[BaseModel]] = {
        "comparison": ComparisonTable,
        "table": LayoutTable,
        "table.printed": PrintedTable,
        "claim": ClaimTable,
        "claim.test": TestTable,
    }
    return tables.get(_table_at(path), ExperimentFile)
