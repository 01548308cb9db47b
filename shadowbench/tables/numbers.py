"""How tables for reading write a number: by its unit, with the digits that mean something.

========= ================================================================ ==================
unit      written                                                          example
========= ================================================================ ==================
ms, fps   3 significant digits, whole digits never rounded away            0.0123, 12.3, 1234
%         2 decimals; what is not 0 (or 100) is never written as 0 (100)   0.35, <0.01, >99.99
bytes     in MiB, 4 significant digits                                     170.7
counts    exactly                                                          786432
other     4 significant digits                                             0.03125, 1.2e-07
========= ================================================================ ==================

CSV and JSON hold the values as they are.
"""

from __future__ import annotations

import math

MEBIBYTE = 2**20

_SHOWN_UNITS = {"bytes": "MiB", "1": "", "receivers": "", "triangles": "", "rounds": "", "pixels": ""}


def shown_unit(unit: str) -> str:
    """Return the unit that a header shows for values in ``unit``; empty for counts and ratios."""
    return _SHOWN_UNITS.get(unit, unit)


def number_text(value: float, unit: str, *, thousands: bool = False) -> str:
    """Return a number as tables for reading show it.

    Args:
        value: A row's value, in ``unit``.
        unit: The column's unit.
        thousands: Separate the thousands with commas.
    """
    if not math.isfinite(value):
        return str(value)
    if unit == "%":
        return _percent(value)
    if unit == "bytes":
        return _significant(value / MEBIBYTE, 4, thousands=thousands)
    if isinstance(value, int):
        return f"{value:,}" if thousands else str(value)
    return _significant(value, 3 if unit in ("ms", "fps") else 4, thousands=thousands)


def _percent(value: float) -> str:
    if value == 0:
        return "0"
    if 0 < value < 0.005:
        return "<0.01"
    if 99.995 <= value < 100:
        return ">99.99"
    return f"{value:.2f}"


def _significant(value: float, digits: int, *, thousands: bool) -> str:
    if value == 0:
        return "0"
    rounded = float(f"{value:.{digits - 1}e}")  # first, so that 9.999 has the exponent of 10.0
    exponent = math.floor(math.log10(abs(rounded)))
    if exponent < -4:
        mantissa, _, power = f"{value:.{digits - 1}e}".partition("e")
        return f"{mantissa}e{int(power)}"
    decimals = max(0, digits - 1 - exponent)
    return f"{value:{',' if thousands else ''}.{decimals}f}"
