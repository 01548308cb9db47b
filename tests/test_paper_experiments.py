"""The papers' experiments: printed values as printed, and cases that are measured."""

import pytest

from shadowbench import experiment


def test_the_alias_free_papers_table_is_printed_as_it_was() -> None:
    paper = experiment.load("aila-laine-2004-table-1")
    table, _ = paper.tables
    names = set(table.values) - {"counters.tested after culling"}  # of which the paper says nothing
    printed = {name: [case.values[name] for case in table.printed] for name in names}
    assert [case.where["scene.triangles"] for case in table.printed] == [1000, 10_000, 100_000, 1_000_000]
    stages = ("transformation", "BSP construction", "rasterization")
    for stage_times, total in zip(
        zip(*(printed[f"stages.{s}"] for s in stages), strict=True), printed["shade_ms"], strict=True
    ):
        assert sum(stage_times) == total, "the paper's totals are the sums of its stages"
    assert set(printed["counters.2D BSP nodes"]) == {786_432 / 48}
    assert [c.sizes for c in paper.comparisons] == [((1024, 768),)]


@pytest.mark.parametrize("name", [n for n in experiment.builtin_names() if n.startswith("aila-laine-2004")])
def test_what_a_paper_prints_belongs_to_cases_that_are_measured(name: str) -> None:
    read = experiment.load(name)
    methods = {choice.name for comparison in read.comparisons for choice in comparison.methods}
    for table in read.tables:
        assert table.where.get("method", "afsm") in methods
        for printed in table.printed:
            assert printed.where.get("method", "afsm") in methods
            # of another size, say from --size, the picture is not the paper's
            assert printed.where["size"] in {f"{w}x{h}" for c in read.comparisons for w, h in c.sizes}
