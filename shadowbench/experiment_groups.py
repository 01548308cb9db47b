"""Groups of experiments: all of a paper's, all of the papers', and simply all, under one name.

A built-in experiment belongs to the paper that its name begins with, so that a new one needs no list.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from shadowbench.errors import ExperimentError, did_you_mean
from shadowbench.experiment import Experiment, builtin_names, load

PAPERS = {
    "aila-laine-2004": "Alias-free shadow maps (Aila & Laine 2004): all experiments",
    "annen-2008": "Exponential shadow maps (Annen et al. 2008): all experiments",
    "buntin-stamminger": "Instanced shadow maps (Buntin & Stamminger): all experiments",
}
"""Beginning of the names of a paper's experiments -> what the group is."""

ALL_PAPERS = "papers"

EVERYTHING = "all"
"""Every experiment that comes with shadowbench: what the published results are of."""

_NUMBER = re.compile(r"(\d+)")


def groups() -> dict[str, tuple[str, ...]]:
    """Return the groups, by name: their experiments, tables before figures, each by its number."""
    names = builtin_names()
    found = {
        paper: tuple(sorted((name for name in names if name.startswith(f"{paper}-")), key=_order)) for paper in PAPERS
    }
    of_papers = tuple(name for members in found.values() for name in members)
    return found | {ALL_PAPERS: of_papers, EVERYTHING: (*of_papers, *(n for n in names if n not in of_papers))}


def title_of(group: str) -> str:
    """Return what a group is, for people."""
    others = {EVERYTHING: "Every experiment that comes with shadowbench"}
    return (PAPERS | others).get(group, "All experiments of the three papers")


def expanded(names: Sequence[str]) -> list[str]:
    """Return names with the experiments of a group in the group's place, each once."""
    known = groups()
    return list(dict.fromkeys(member for name in names for member in known.get(name, (name,))))


def load_one(name: str) -> Experiment:
    """Return an experiment as :func:`shadowbench.experiment.load` does; its message knows the groups as well.

    Raises:
        ExperimentError: There is no such experiment, or its file is wrong.
    """
    known = builtin_names()
    if name not in known and len(Path(name).parts) == 1 and not name.endswith(".toml") and not Path(name).exists():
        hint = did_you_mean(name, [*known, *groups()], noun="experiment")
        raise ExperimentError(f"no experiment is called '{name}'; {hint}")
    return load(name)


def _order(name: str) -> tuple[int, list[tuple[int, str]]]:
    kind = 0 if "-table-" in name else 1 if "-figure-" in name else 2
    return kind, [(int(part), "") if part.isdigit() else (-1, part) for part in _NUMBER.split(name)]
