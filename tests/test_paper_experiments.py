"""The papers' experiments: printed values as printed, and cases that are measured."""

import itertools
from collections.abc import Iterator
from typing import Any

import pytest

from shadowbench import experiment
from shadowbench.plugins import Registry
from shadowbench.rows import LONG_FIELDS, ResultRow
from shadowbench.runner.resolving import resolve_parameters
from shadowbench.tables.claims import answers_of


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


PAPERS = [name for name in experiment.builtin_names() if name not in ("quick", "tour")]


@pytest.mark.parametrize("name", PAPERS)
def test_what_a_paper_prints_belongs_to_cases_that_are_measured(name: str) -> None:
    """Every printed value finds a configuration of its experiment that all of its conditions are true of."""
    read = experiment.load(name)
    measured = [
        {"method": method.name, "light": light, "camera": camera, "size": f"{size[0]}x{size[1]}"}
        | {f"scene.{key}": value for key, value in scene_values.items()}
        | method_values
        for comparison in read.comparisons
        for scene in comparison.scenes
        for scene_values in scene.expand()
        for method in comparison.methods
        for method_values in method.expand()
        for light in comparison.lights
        for camera in comparison.cameras
        for size in comparison.sizes
    ]
    for table in read.tables:
        assert _holds(table.where, measured), table.title
        for printed in table.printed:
            assert _holds(table.where | printed.where, measured), printed.where


def _holds(conditions: dict[str, Any], measured: list[dict[str, Any]]) -> bool:
    """Whether some configuration meets all conditions; a parameter it does not mention may have any value."""
    return any(all(str(case.get(key, value)) == str(value) for key, value in conditions.items()) for case in measured)


def test_the_printed_bytes_of_filtered_maps_are_those_of_a_full_mip_chain() -> None:
    table = experiment.load("annen-2008-figure-1").tables[0]
    texels = sum((2048 >> level) ** 2 for level in range(12))
    values_of_a_texel = {"esm": 4, "vsm": 2 * 4, "csm": 2 * 16}
    printed = {case.where["method"]: case.values["bytes_kept"] for case in table.printed}
    assert printed == {method: texels * size for method, size in values_of_a_texel.items()}


def test_every_map_size_and_window_of_the_filtered_maps_first_table_is_printed() -> None:
    (table, _) = experiment.load("annen-2008-table-1").tables
    assert len(table.printed) == 4 * 9
    keys = ("method", "classification", "kernel", "resolution")
    assert len({tuple(case.where.get(key) for key in keys) for case in table.printed}) == 36


@pytest.mark.parametrize("name", [n for n in PAPERS if n.startswith("annen-2008")])
def test_classified_failures_are_printed_growing_with_the_window(name: str) -> None:
    for table in experiment.load(name).tables:
        rows: dict[Any, list[float]] = {}
        for case in table.printed:
            if "classified_percent" in case.values:
                rows.setdefault(case.where["classification"], []).append(case.values["classified_percent"])
        for values in rows.values():
            assert values == sorted(values)
        if rows:
            assert all(z >= t for z, t in zip(rows["z-max"], rows["threshold"], strict=True))


def test_one_map_of_the_same_bytes_stands_beside_the_instanced_papers_twelve() -> None:
    paper = experiment.load("buntin-stamminger-figure-5")
    (twelve,) = (case.values["bytes_kept"] for case in paper.tables[0].printed if "bytes_kept" in case.values)
    assert twelve == 12 * 512 * 512 * 4
    (comparison,) = paper.comparisons
    of_one_map = [
        4 * int(v["resolution"]) ** 2 for m in comparison.methods if m.name == "shadow-map" for v in m.expand()
    ]
    assert min(abs(size / twelve - 1.0) for size in of_one_map) < 1e-3


def _planned(read: experiment.Experiment, values: set[str]) -> Iterator[ResultRow]:
    """Yield a row for each of an experiment's cases, of which all are alike in everything that claims ask for."""
    registry = Registry()
    number = itertools.count()
    long_values = {
        owner: {name.partition(".")[2]: 1.0 for name in values if name.startswith(f"{owner}.")}
        for owner in LONG_FIELDS[:3]
    }
    plain = {
        name: 1.0 for name in values if name in ResultRow.model_fields and ResultRow.model_fields[name].default is None
    }
    times = [f"{phase}_ms" for phase in ("build", "shade", "camera", "static_frame", "dynamic_frame")]
    plain |= {f"{name}{end}": 1.0 for name in times for end in ("", "_low", "_high")}
    for comparison in read.comparisons:
        for scene, light, camera, (width, height), samples, layers, moving in itertools.product(
            *(comparison.scenes, comparison.lights, comparison.cameras),
            *(comparison.sizes, comparison.pixel_samples, comparison.layers, comparison.moving),
        ):
            for scene_values, method in itertools.product(scene.expand(), comparison.methods):
                for method_values in method.expand():
                    yield ResultRow(
                        run_id="run",
                        experiment=read.name,
                        comparison="c",
                        case_key=f"{next(number)}",
                        quality_key="q",
                        scene=scene.name,
                        scene_parameters=resolve_parameters(registry.scene(scene.name), scene.name, scene_values),
                        method=method.name,
                        method_parameters=resolve_parameters(registry.method(method.name), method.name, method_values),
                        light=light or "",
                        camera=camera or "",
                        width=width,
                        height=height,
                        pixel_samples=samples,
                        layers=layers,
                        moving=moving,
                        device="cpu",
                        threads=1,
                        outcome="ok",
                        visibility_digest="d",
                        **(plain | {"triangles": 1, "receivers": width * height}),
                        **long_values,
                    )


@pytest.mark.parametrize("name", PAPERS)
def test_every_claim_finds_the_cases_that_decide_it(name: str) -> None:
    """Whatever the values are, no claim stays open for want of a case, for two in one place, or of a number."""
    read = experiment.load(name)
    tests = [test for claim in read.claims for test in claim.tests]
    values = {value for test in tests for value in (test.value, test.per, test.than_value) if value}
    rows = list(_planned(read, values))
    for answer in answers_of(read.name, read.claims, rows):
        for finding in answer.findings:
            assert finding.value is not None, f"{answer.name}: {finding.evidence}"


@pytest.mark.parametrize("name", PAPERS)
def test_a_claim_has_words_of_our_own_and_a_source(name: str) -> None:
    read = experiment.load(name)
    assert read.claims, "a paper's experiment claims something"
    for claim in read.claims:
        assert claim.statement.endswith(".")
        assert len(claim.statement) <= 250
        assert "section" in (claim.source or read.source) or "Table" in claim.source or "Figure" in claim.source
