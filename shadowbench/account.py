"""How the visibility of one receiver came about: what a technique's ``account()`` returns.

An :class:`Account` is the technique's formula with this receiver's numbers in it, as steps in the order of the
computation: named quantities with units, a table where there are many alike (the taps of a filter), and the formula
itself as lines of text. Its last number is the visibility that ``shade()`` wrote. Plain values only, so that the
command line can print it and JSON can hold it: whoever makes one converts NumPy's numbers first (:func:`plain`).
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import Any

Value = bool | int | float | str | tuple[float, ...]


@dataclass(frozen=True)
class Quantity:
    """A number with a name.

    Attributes:
        name: In the words of the paper or of the parameters.
        value: A number, a vector, a text, or whether something holds.
        unit: ``texels``, ``depth``, ``scene units``; empty for a pure number.
    """

    name: str
    value: Value
    unit: str = ""


@dataclass(frozen=True)
class Table:
    """Many numbers alike: a line a tap, a caster, a term.

    Attributes:
        title: What a line is.
        columns: Headings.
        rows: Values, one for each heading.
    """

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[Value, ...], ...]


@dataclass(frozen=True)
class Step:
    """A step of the computation.

    Attributes:
        title: What is done.
        quantities: What goes in and comes out.
        formula: Lines with the numbers filled in.
        table: Where there are many numbers alike.
    """

    title: str
    quantities: tuple[Quantity, ...] = ()
    formula: tuple[str, ...] = ()
    table: Table | None = None


@dataclass(frozen=True)
class Account:
    """The whole computation.

    Attributes:
        steps: In order.
        visibility: What it gives: one number, or three where casters have a coloured transmittance.
        rounding: How far that may be from what ``shade()`` wrote; 0 where it is the same to the last bit.
    """

    steps: tuple[Step, ...]
    visibility: float | tuple[float, ...]
    rounding: float = 0.0

    def as_json(self) -> dict[str, Any]:
        """Return the account as JSON values; what is not finite is ``None``."""
        found: dict[str, Any] = json_value(dataclasses.asdict(self))
        return found


def json_value(value: Any) -> Any:
    """Return plain values, in dictionaries and sequences, as JSON has them."""
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, dict):
        return {key: json_value(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [json_value(inner) for inner in value]
    return value


def plain(value: Any) -> Any:
    """Return a NumPy or Warp number, or an array of them, as Python's numbers and tuples of them."""
    found = value.tolist() if hasattr(value, "tolist") else value
    if hasattr(found, "__iter__") and not isinstance(found, str):
        return tuple(plain(inner) for inner in found)
    return found


def number(value: float) -> str:
    """Return a number for a formula: short where that loses nothing to the eye, else with eight digits."""
    return f"{value:.8g}"
