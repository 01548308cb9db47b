"""What a user may write for a scene, a method, a size or a thread count, on the command line and in a file alike.

``NAME[:key=v,key=v/v/v]`` names a plugin and its parameters; ``/`` separates swept values and quotes keep it in one.
Everything here raises ``ValueError`` with a message for one line of a terminal; :mod:`shadowbench.experiment` says in
which file and line, or for which option, it happened.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from shadowbench.errors import did_you_mean

LARGEST_SIDE = 16384
"""Pixels; a larger picture does not fit the memory of the machines this is made for."""

MOST_THREADS = 1024
MOST_PIXEL_SAMPLES = 256
MOST_LAYERS = 64

EVERYTHING = "everything"
MOVING = {
    EVERYTHING: "all that can; build() starts from nothing",
    "object": "one caster, the first, takes a step and turns",
    "light": "the light takes a step, or turns if it is parallel",
    "camera": "the camera goes round its target by a degree",
}
"""What may move between two frames (:mod:`shadowbench.motion`), and what that means."""

MESH_SUFFIXES = frozenset(
    {".ply", ".obj", ".stl", ".gltf", ".glb", ".vtk", ".vtp", ".vtu", ".vts", ".vtr", ".vtm"}
    | {".usd", ".usda", ".usdc", ".usdz"}
)
"""Endings by which a scene's name is taken for a mesh file's path."""

_NAME_AND_VALUES = re.compile(r"(?P<name>.+?)(?::(?P<values>[A-Za-z_]\w*\s*=.*))?", re.DOTALL)
_PAIR = re.compile(r"\s*(?P<key>[A-Za-z_]\w*)\s*=(?P<values>.*)", re.DOTALL)

Scalar = str | int | float | bool


@dataclass(frozen=True)
class Choice:
    """A scene or method and the values of its parameters, as written.

    Attributes:
        name: A plugin's name or, for a scene, a mesh file's path.
        values: Parameter to the values it sweeps; one value for a parameter that is not swept.
    """

    name: str
    values: dict[str, tuple[Scalar, ...]] = field(default_factory=dict)

    def expand(self) -> Iterator[dict[str, Scalar]]:
        """Yield each combination of swept values; the last parameter varies fastest."""
        for combination in itertools.product(*self.values.values()):
            yield dict(zip(self.values, combination, strict=True))

    @property
    def is_mesh_file(self) -> bool:
        """Whether the name can only be a path."""
        return Path(self.name).suffix.lower() in MESH_SUFFIXES or "/" in self.name or "\\" in self.name

    def __str__(self) -> str:
        pairs = (f"{key}={'/'.join(map(_written, values))}" for key, values in self.values.items())
        text = ",".join(pairs)
        return f"{self.name}:{text}" if text else self.name


def choice_of_text(text: str) -> Choice:
    """Return the choice that ``NAME[:key=v,key=v/v/v]`` names."""
    found = _NAME_AND_VALUES.fullmatch(text.strip())
    if found is None:
        raise ValueError("a name must not be empty")
    choice = Choice(found["name"], {})
    if ":" in choice.name and not choice.is_mesh_file:
        raise ValueError(f"'{text}': after the colon come parameters, as in {choice.name.split(':')[0]}:key=value")
    for pair in _split(found["values"], ",") if found["values"] else ():
        matched = _PAIR.fullmatch(pair)
        if matched is None:
            raise ValueError(f"'{text}': '{pair.strip()}' is not key=value")
        if matched["key"] in choice.values:
            raise ValueError(f"'{text}': parameter '{matched['key']}' is given twice")
        values = [value.strip() for value in _split(matched["values"], "/")]
        if not all(values):
            raise ValueError(f"'{text}': parameter '{matched['key']}' has an empty value")
        choice.values[matched["key"]] = tuple(value.replace('"', "") for value in values)
    return choice


def choice_of_table(table: dict[str, Any]) -> Choice:
    """Return the choice that ``{name = "pcf", kernel = [3, 7]}`` names; a list sweeps."""
    name = table.get("name")
    if not isinstance(name, str) or not name:
        raise ValueError("a table here needs a 'name'")
    values: dict[str, tuple[Scalar, ...]] = {}
    for key, value in table.items():
        if key == "name":
            continue
        swept = tuple(value) if isinstance(value, list) else (value,)
        if not swept:
            raise ValueError(f"parameter '{key}' sweeps an empty list")
        if not all(isinstance(v, Scalar) for v in swept):
            raise ValueError(f"parameter '{key}' must be a number, a text, true or false, or a list of them")
        values[key] = swept
    return Choice(name, values)


def size_of(text: str) -> tuple[int, int]:
    """Return width and height of ``WIDTHxHEIGHT`` [pixels]."""
    found = re.fullmatch(r"\s*([+-]?\d+)\s*x\s*([+-]?\d+)\s*", text, re.IGNORECASE)
    if found is None:
        raise ValueError(f"a size is written WIDTHxHEIGHT, like 1024x768, not '{text}'")
    width, height = int(found[1]), int(found[2])
    if not (1 <= width <= LARGEST_SIDE and 1 <= height <= LARGEST_SIDE):
        raise ValueError(f"a picture has 1 to {LARGEST_SIDE} pixels a side, not '{text}'")
    return width, height


def thread_count_of(value: Any) -> int:
    """Return a number of threads."""
    return _count_of(value, "threads", MOST_THREADS)


def pixel_sample_count_of(value: Any) -> int:
    """Return a number of samples of every pixel."""
    return _count_of(value, "samples of a pixel", MOST_PIXEL_SAMPLES)


def layer_count_of(value: Any) -> int:
    """Return a number of surfaces that a sample may see."""
    return _count_of(value, "layers", MOST_LAYERS)


def moving_of(value: Any) -> str:
    """Return what moves between two frames, one of :data:`MOVING`."""
    if value not in MOVING:
        raise ValueError(f"nothing moves like '{value}'; {did_you_mean(str(value), MOVING, noun='motion')}")
    return str(value)


def _count_of(value: Any, what: str, most: int) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or not 1 <= value <= most:
        raise ValueError(f"a number of {what} lies between 1 and {most}, not {value!r}")
    return value


def _split(text: str, separator: str) -> list[str]:
    """Split at a separator outside quotes; an unpaired quote is an ordinary character."""
    parts, quoted = [""], False
    paired = text.count('"') % 2 == 0
    for character in text:
        quoted ^= character == '"' and paired
        if character == separator and not quoted:
            parts.append("")
        else:
            parts[-1] += character
    return parts


def _written(value: Scalar) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    text = f"{value:g}" if isinstance(value, float) else str(value)
    return f'"{text}"' if set(text) & set("/,") else text
