"""Figures for papers: there in both formats, the same every time, and safe whatever a title says."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree as ET

import pytest
from stored_rows import some_row, some_run

from shadowbench import report
from shadowbench.errors import UsageError
from shadowbench.report.chart import Axis, Plot, Point, Series
from shadowbench.report.figures import write_figures
from shadowbench.rows import RunRecord
from shadowbench.store import Store


def plot(title: str = "T", *ys: float) -> Plot:
    points = tuple(Point(k + 1.0, y, y, y, k + 1.0, k + 1.0, "p", name="a $name$ with_marks") for k, y in enumerate(ys))
    return Plot(title, Axis("x", is_log=True), Axis("y [%]", is_log=True), (Series("s", 0, points),))


def test_every_chart_is_there_in_both_formats(tmp_path: Path) -> None:
    written = write_figures([plot("Cost against quality: a, b", 1.0, 2.0), plot("T", 0.0, 2.0)], tmp_path / "new")
    assert [path.name for path in written] == [
        *("01-cost-against-quality-a-b.pdf", "01-cost-against-quality-a-b.svg", "02-t.pdf", "02-t.svg")
    ]
    assert written[0].read_bytes().startswith(b"%PDF-")
    assert ET.parse(written[1]).getroot().tag.endswith("svg")


def test_the_same_chart_gives_the_same_bytes(tmp_path: Path) -> None:
    one, again = (write_figures([plot("T", 1.0, 0.0, 3.0)], tmp_path / name) for name in "ab")
    for path, other in zip(one, again, strict=True):
        assert path.read_bytes() == other.read_bytes()
        assert b"Date" not in path.read_bytes()


def test_a_hostile_title_leads_to_no_other_folder_and_is_no_formula(tmp_path: Path) -> None:
    titles = ["../../etc/passwd", "\x1b\u202e$\\frac{1}{0$", "<script>", "x" * 500]
    written = write_figures([plot(title, 1.0, 2.0) for title in titles], tmp_path)
    assert {path.parent for path in written} == {tmp_path}
    assert all(len(path.name) < 100 for path in written)
    assert len(set(written)) == 2 * len(titles)


def test_a_folder_that_cannot_be_made_is_a_usage_error(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(UsageError, match="--figures"):
        write_figures([plot("T", 1.0, 2.0)], tmp_path / "file" / "folder")


def test_a_runs_figures_are_those_of_its_page(store: Store, run: RunRecord, tmp_path: Path) -> None:
    for method, total in (("a", 5.0), ("b", 9.0)):
        store.add_row(some_row(method, dynamic_frame_ms=total, stages={"fill": 1.0}))
    written = report.write_figures(store, run, tmp_path)
    assert [path.stem[3:].partition("-box")[0] for path in written[::2]] == [
        *("where-a-dynamic-frame-s-time-goes", "cost-against-quality")
    ]


def test_a_run_without_times_has_no_figures(store: Store, run: RunRecord, tmp_path: Path) -> None:
    assert report.write_figures(store, some_run(), tmp_path) == []
