"""How a plugin declares a parameter: one call that carries default, unit, range and help.

``Parameters`` classes of methods and scenes derive from :class:`ParameterModel`; the command line, the experiment
files, ``shadowbench show`` and the report all read the same declaration.
"""

from __future__ import annotations

from typing import Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError
from pydantic_core import PydanticUndefined

from shadowbench.errors import ParameterError, did_you_mean


class ParameterModel(BaseModel):
    """Frozen, refuses unknown names, refuses NaN and infinity, checks its defaults."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, validate_default=True)


def parameter(default: Any = ..., *, unit: str, help: str, **limits: Any) -> Any:  # noqa: A002 - the field's word
    """Declare a parameter.

    Args:
        default: Used when the user gives none; ``...`` makes the parameter required.
        unit: ``"texels"``, ``"degrees"``, ``"scene units"``, ``"depth"`` (linear light-space depth) or ``"1"``.
        help: One sentence.
        limits: Pydantic's ``ge``, ``gt``, ``le``, ``lt``, ``multiple_of``.
    """
    return Field(default, description=help, json_schema_extra={"unit": unit}, **limits)


def parse_parameters(model: type[BaseModel], values: dict[str, Any], *, owner: str) -> BaseModel:
    """Check ``values`` (text or typed) against ``model``.

    Args:
        model: A plugin's ``Parameters``.
        values: As written by the user.
        owner: For messages, e.g. ``"method 'pcf'"``.

    Raises:
        ParameterError: One line that names the parameter, what is wrong and what would be right.
    """
    try:
        return model.model_validate(values)
    except ValidationError as error:
        raise ParameterError(_one_line(error, model, owner)) from None


def _one_line(error: ValidationError, model: type[BaseModel], owner: str) -> str:
    # an unknown name first: beside it, "missing" is most likely the same slip of the pen
    first = min(error.errors(), key=lambda e: e["type"] != "extra_forbidden")
    name = ".".join(str(part) for part in first["loc"])
    if first["type"] == "extra_forbidden":
        return f"{owner} has no parameter '{name}'; {did_you_mean(name, model.model_fields, noun='parameter')}"
    if first["type"] == "missing":
        return f"{owner} needs the parameter '{name}'"
    wish = first["msg"].removeprefix("Value error, ")
    wish = wish[:1].lower() + wish[1:]
    if not name:
        return f"{owner}: {wish}"
    return f"{owner}: parameter '{name}' = {first['input']!r}: {wish}"


def describe_parameters(model: type[BaseModel]) -> list[dict[str, str]]:
    """Return one entry per parameter: name, default, unit, range and help, as text."""
    described = []
    schema = model.model_json_schema().get("properties", {})
    for name, info in model.model_fields.items():
        extra = info.json_schema_extra if isinstance(info.json_schema_extra, dict) else {}
        default = "required" if info.default is PydanticUndefined else str(info.default)
        if isinstance(info.default, bool):
            default = default.lower()  # as it is written on a command line
        described.append(
            {
                "name": name,
                "default": default,
                "unit": str(extra.get("unit", "1")),
                "range": _range_text(schema.get(name, {})),
                "help": info.description or "",
            }
        )
    return described


def _range_text(schema: dict[str, Any]) -> str:
    if "enum" in schema:
        return " | ".join(str(choice) for choice in schema["enum"])
    if schema.get("type") == "boolean":
        return "true | false"
    low = f"[{schema['minimum']}" if "minimum" in schema else f"({schema.get('exclusiveMinimum', '-inf')}"
    high = f"{schema['maximum']}]" if "maximum" in schema else f"{schema.get('exclusiveMaximum', 'inf')})"
    return "" if (low, high) == ("(-inf", "inf)") else f"{low}, {high}"
