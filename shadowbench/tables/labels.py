"""Labels of methods and scenes: as short as they can be while the cases of a table stay apart.

A label is the name with those parameters that vary among the table's cases of that method or scene, or that differ
from their defaults (where the run recorded them), in the plugin's order: ``shadow-map(resolution=512)``. A parameter
with a column of its own is left out.
"""

from __future__ import annotations

import json
from collections.abc import Collection, Mapping, Sequence
from typing import Any, Literal

from shadowbench.rows import ResultRow, method_label

Kind = Literal["method", "scene"]


class Labels:
    """The labels of one table's methods or scenes."""

    def __init__(
        self,
        kind: Kind,
        rows: Sequence[ResultRow],
        *,
        with_columns: Collection[str] = (),
        defaults: Mapping[str, Mapping[str, Any]] | None = None,
    ) -> None:
        """Find out which parameters tell the cases apart.

        Args:
            kind: What to label.
            rows: The table's rows.
            with_columns: The table's index and pivot columns, whose parameters need not be in a label.
            defaults: Method or scene -> parameter -> default, as far as known.
        """
        self._kind = kind
        parameters: dict[str, list[dict[str, Any]]] = {}
        for row in rows:
            parameters.setdefault(self._name(row), []).append(self._parameters(row))
        own_column = {name.removeprefix(f"{kind}.") for name in with_columns}
        self._shown = {
            name: _telling(found, (defaults or {}).get(name, {})) - own_column for name, found in parameters.items()
        }

    def of(self, row: ResultRow) -> str:
        """Return the label of a row's method or scene."""
        name = self._name(row)
        return method_label(name, self._parameters(row), only=self._shown[name])

    def _name(self, row: ResultRow) -> str:
        return row.method if self._kind == "method" else row.scene

    def _parameters(self, row: ResultRow) -> dict[str, Any]:
        return row.method_parameters if self._kind == "method" else row.scene_parameters


def _telling(cases: Sequence[Mapping[str, Any]], defaults: Mapping[str, Any]) -> set[str]:
    values: dict[str, set[str]] = {}
    for case in cases:
        for name, value in case.items():
            values.setdefault(name, set()).add(_comparable(value))
    varying = {name for name, found in values.items() if len(found) > 1}
    unusual = {name for name, default in defaults.items() if values.get(name, set()) - {_comparable(default)}}
    return varying | unusual


def _comparable(value: Any) -> str:
    return json.dumps(value, sort_keys=True, default=str)
