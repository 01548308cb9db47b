"""Groups: every experiment of a paper under one name."""

import pytest

from shadowbench.errors import ExperimentError
from shadowbench.experiment import builtin_names
from shadowbench.experiment_groups import PAPERS, expanded, groups, load_one


def test_every_papers_experiment_is_in_its_group_and_in_papers() -> None:
    found = groups()
    of_papers = [name for name in builtin_names() if name not in ("quick", "tour")]
    assert sorted(found["papers"]) == of_papers
    assert sorted(name for paper in PAPERS for name in found[paper]) == of_papers
    assert not set(found) & set(builtin_names())


def test_tables_come_before_figures_in_the_order_of_their_numbers() -> None:
    members = groups()["annen-2008"]
    assert members[:3] == tuple(f"annen-2008-table-{n}" for n in (1, 2, 3))
    figures = [name.removeprefix("annen-2008-figure-") for name in members[3:]]
    assert figures == ["1", "2b", "4", "5b", "6", "7", "8", "9", "10"]


def test_a_group_stands_for_its_members_each_once() -> None:
    assert expanded(["quick", "annen-2008", "annen-2008-table-1"]) == ["quick", *groups()["annen-2008"]]


def test_groups_are_suggested_too() -> None:
    with pytest.raises(ExperimentError, match="no experiment is called 'paper'; did you mean 'papers'"):
        load_one("paper")
    assert load_one("quick").name == "quick"
