"""Which published cases are computed again: of every experiment some of each technique, where a picture is cheap."""

from __future__ import annotations

from collections.abc import Sequence

from shadowbench.rows import Outcome, ResultRow

MOST_OF_AN_EXPERIMENT = 5

_OF_OTHERS = ("embree", "opengl")
"""Beginnings of the names of peers, whose bits are their libraries' and the processor's affair."""

_MOST_TRIANGLES = 400_000
_MOST_RECEIVERS = 700_000


def sampled(rows: Sequence[ResultRow]) -> list[ResultRow]:
    """Return the cases to compute again, in the rows' order, no case twice.

    Of each experiment it is the cheapest view, and in it one case of every technique and of every choice that is made
    by a word (how failures are found, how rotations are treated), evenly spread where these are many.
    """
    chosen: dict[str, ResultRow] = {}
    for experiment in dict.fromkeys(row.experiment for row in rows):
        cheap = [row for row in rows if row.experiment == experiment and _is_cheap(row)]
        if not cheap:
            continue
        view = min(map(_view, cheap), key=lambda view: view[0])
        kinds: dict[tuple[object, ...], ResultRow] = {}
        for row in cheap:
            if _view(row) == view:
                kinds.setdefault(_kind(row), row)
        found = list(kinds.values())
        step = max(1.0, len(found) / MOST_OF_AN_EXPERIMENT)
        picked = [found[int(number * step)] for number in range(min(len(found), MOST_OF_AN_EXPERIMENT))]
        chosen |= {row.case_key: row for row in picked if row.case_key not in chosen}
    return list(chosen.values())


def _is_cheap(row: ResultRow) -> bool:
    is_repeatable = row.outcome is Outcome.OK and row.device == "cpu" and row.changed_count is None
    is_small = (row.triangles or 0) <= _MOST_TRIANGLES and (row.receivers or 0) <= _MOST_RECEIVERS
    return is_repeatable and is_small and not row.method.startswith(_OF_OTHERS)


def _view(row: ResultRow) -> tuple[int, str]:
    """Return what a view costs, about, and its name."""
    cost = (row.receivers or 0) * row.layers + (row.triangles or 0)
    name = [row.scene, sorted(row.scene_parameters.items()), row.light, row.camera, row.width, row.height, row.layers]
    return cost, repr(name)


def _kind(row: ResultRow) -> tuple[object, ...]:
    words = [item for item in sorted(row.method_parameters.items()) if isinstance(item[1], str | bool)]
    return row.method, *words
