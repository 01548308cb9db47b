"""The shape of ``[[claim]]`` in an experiment file, as :mod:`shadowbench.claim` documents it.

Pydantic models mirror the TOML tables and refuse whatever has no meaning; :mod:`shadowbench.experiment_file` says in
which file and line.
"""

from __future__ import annotations

from typing import Annotated, Any, Self

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, PlainValidator, model_validator

from shadowbench.claim import COMPARISONS, CROSSINGS, KEYS_OF, POWER, RELATIONS, WITH_TOLERANCE, Claim, Test
from shadowbench.errors import did_you_mean
from shadowbench.toml_values import Conditions, Name, Names, ValueColumn, as_list

_OF_ALL = ("value", "per", "of", "is", "where", "each")


def _relation(value: Any) -> str:
    if value not in RELATIONS:
        raise ValueError(f"nothing is said with is = '{value}'; {did_you_mean(str(value), RELATIONS, noun='word')}")
    return str(value)


def _text(value: Any) -> str:
    if not isinstance(value, str) or not value.strip():
        raise ValueError(f"expected a sentence, not {value!r}")
    return " ".join(value.split())


CaseConditions = Annotated[dict[Name, Conditions], Field(min_length=1)]


class TestTable(BaseModel):
    """A ``[[claim.test]]``."""

    __test__ = False  # its name is not pytest's

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False, strict=True)

    value: ValueColumn
    per: ValueColumn | None = None
    of: CaseConditions = Field(default_factory=dict)
    relation: Annotated[str, PlainValidator(_relation)] = Field(alias="is")
    than: CaseConditions | None = None
    than_value: ValueColumn | None = None
    times: Annotated[float, Field(gt=0.0)] | None = None
    number: float | None = None
    over: Name | None = None
    relative_to: CaseConditions | None = None
    at_least: float | None = None
    at_most: float | None = None
    within: Annotated[float, Field(gt=0.0, lt=1.0)] | None = None
    where: CaseConditions = Field(default_factory=dict)
    each: Names | None = None

    @model_validator(mode="after")
    def _keys_belong_together(self) -> Self:
        relation, given = self.relation, self.model_fields_set
        allowed = KEYS_OF[relation] + (("within",) if relation in WITH_TOLERANCE else ())
        for key in sorted(given - {*_OF_ALL, *allowed, "relation"}):
            raise ValueError(f"'{key}' does not go with is = '{relation}'; {did_you_mean(key, allowed, noun='key')}")
        if relation in COMPARISONS:
            self._check_sides(given)
        elif self.over is None:
            raise ValueError(f"is = '{relation}' needs 'over', the parameter or column of a sweep")
        if relation in CROSSINGS and self.than is None:
            raise ValueError(f"is = '{relation}' needs 'than', the cases that it crosses")
        if relation == POWER and self.at_least is None and self.at_most is None:
            raise ValueError(f"is = '{relation}' needs 'at_least' or 'at_most', the bounds of the exponent")
        return self

    def _check_sides(self, given: set[str]) -> None:
        sides = given & {"than", "number"}
        if len(sides) == 2:
            raise ValueError("a value is compared 'than' other cases or with a 'number', not both")
        if not sides and "than_value" not in given:
            raise ValueError(f"is = '{self.relation}' needs 'than', the cases to compare with, or a 'number'")
        if "number" in given and given & {"times", "than_value"}:
            raise ValueError("'times' and 'than_value' go with 'than', not with a 'number'")

    def test(self) -> Test:
        """Return the test, free of the file's form."""
        return Test(**{**self.model_dump(exclude={"each"}), "each": tuple(self.each or ())})


class ClaimTable(BaseModel):
    """A ``[[claim]]``."""

    model_config = ConfigDict(extra="forbid")

    name: Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_.-]*$")]
    statement: Annotated[str, PlainValidator(_text)]
    source: str = ""
    test: Annotated[list[TestTable], BeforeValidator(as_list), Field(min_length=1)]

    def claim(self) -> Claim:
        """Return the claim, free of the file's form."""
        return Claim(self.name, self.statement, self.source, tuple(each.test() for each in self.test))
