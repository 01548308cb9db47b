"""The cases of a claim's test, in groups that are alike but for what the test compares.

Which columns make a group is documented in :mod:`shadowbench.claim`.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

from shadowbench.claim import Conditions, Test, bare, conditions_in_words, shown
from shadowbench.errors import did_you_mean
from shadowbench.rows import ResultRow, method_label
from shadowbench.tables.columns import ROW_COLUMNS, parameter_names, value_of
from shadowbench.tables.layout import SETTING

_OF_THE_SIZE = ("receivers", "scored", "width", "height")
"""Columns that a sweep over the picture's size may run over."""


@dataclass
class Group:
    """Cases that are alike but for what a test compares.

    Attributes:
        key: What they have in common, by column; a side's own columns begin with ``of`` or ``than``.
        ones, others: The two sides.
    """

    key: dict[str, Any]
    ones: list[ResultRow] = field(default_factory=list)
    others: list[ResultRow] = field(default_factory=list)


def meets(row: ResultRow, conditions: Conditions) -> bool:
    """Return whether a case has these values, or for a list one of them."""
    return all(
        value_of(row, name) in wanted if isinstance(wanted, list) else value_of(row, name) == wanted
        for name, wanted in conditions.items()
    )


def nothing_meets(rows: Sequence[ResultRow], conditions: Conditions) -> str:
    """Say which condition no case meets, or that none meets them all."""
    if not rows:
        return "no case has been measured"
    parameters = parameter_names(rows)
    for name, wanted in conditions.items():
        values = {value_of(row, name) for row in rows}
        if values == {None}:
            bare = name.removeprefix("method.").removeprefix("scene.")
            return f"no case has '{name}'; {did_you_mean(bare, [*parameters, *ROW_COLUMNS], noun='name')}"
        if not any(value in (wanted if isinstance(wanted, list) else [wanted]) for value in values):
            return f"no case has {name} {shown(wanted)}"
    return f"no case has {conditions_in_words(conditions)}"


def groups_of(test: Test, ones: Sequence[ResultRow], others: Sequence[ResultRow]) -> list[Group]:
    """Return the groups: what is alike, then each part of one side with each part of the other."""
    other_side = test.than if test.than is not None else test.relative_to or {}
    compared_by = {*test.of, *other_side, test.over}
    if test.over in _OF_THE_SIZE:
        compared_by.add("size")
    shared = [name for name in dict.fromkeys((*SETTING, *test.each)) if name not in compared_by]
    alike: dict[tuple[Any, ...], Group] = {}
    for side, rows in (("ones", ones), ("others", others)):
        for row in rows:
            key = {name: _scene(row, test) if name == "scene" else value_of(row, name) for name in shared}
            getattr(alike.setdefault(tuple(key.values()), Group(key)), side).append(row)
    own = [name for name in test.each if name in test.of]
    their_own = [name for name in test.each if name in other_side]
    return [
        Group(group.key | key | their_key, part, their_part)
        for group in alike.values()
        for key, part in _parts(group.ones, own, "of")
        for their_key, their_part in _parts(_other_cases(test, part, group.others), their_own, "than")
    ]


def _other_cases(test: Test, ones: list[ResultRow], others: list[ResultRow]) -> list[ResultRow]:
    """Return what cases are compared with: those of the other side, or themselves in another column."""
    return ones if test.than_value is not None and test.than is None else others


def _parts(
    rows: list[ResultRow], columns: Sequence[str], side: str
) -> Iterator[tuple[dict[str, Any], list[ResultRow]]]:
    parts: dict[tuple[Any, ...], list[ResultRow]] = {}
    for row in rows:
        parts.setdefault(tuple(value_of(row, name) for name in columns), []).append(row)
    for values, part in (parts or {(): []}).items():
        yield {f"{side} {name}": value for name, value in zip(columns, values, strict=False)}, part


def _scene(row: ResultRow, test: Test) -> str:
    """Return a scene with those of its parameters that the test compares nothing by."""
    sides = (test.of, test.than or {}, test.relative_to or {})
    named = {name.removeprefix("scene.") for side in sides for name in side} | {
        (test.over or "").removeprefix("scene.")
    }
    kept = {name: value for name, value in row.scene_parameters.items() if name not in named}
    return json.dumps([row.scene, kept], sort_keys=True, default=str)


def group_names(groups: Sequence[Group]) -> list[str]:
    """Return what tells each group from the others."""
    columns = list(dict.fromkeys(name for group in groups for name in group.key))
    varying = [name for name in columns if len({group.key.get(name) for group in groups}) > 1]
    scenes = _scene_names({group.key["scene"] for group in groups if "scene" in group.key})
    return [
        ", ".join(scenes[group.key[name]] if name == "scene" else _label(name, group.key.get(name)) for name in varying)
        for group in groups
    ]


def _label(column: str, value: Any) -> str:
    """Return ``kernel 5``, ``esm``, or for one side's own column ``than csm``."""
    side, _, own = column.rpartition(" ")
    text = shown(value) if (own or column) == "method" else f"{bare(own or column)} {shown(value)}"
    return f"against {text}" if side == "than" else text


def _scene_names(found: set[str]) -> dict[str, str]:
    """Return short names of scenes: with the parameters that vary."""
    read = {text: json.loads(text) for text in found}
    varying = {
        (name, parameter)
        for name, parameters in read.values()
        for parameter, value in parameters.items()
        if any(other == name and others.get(parameter) != value for other, others in read.values())
    }
    return {
        text: method_label(name, parameters, only={parameter for owner, parameter in varying if owner == name})
        for text, (name, parameters) in read.items()
    }
