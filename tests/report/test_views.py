"""Rows put together by view."""

from __future__ import annotations

from stored_rows import some_row, some_run, with_pictures

from shadowbench.report.embedding import PicturePool
from shadowbench.report.views import by_view, scene_views, titles
from shadowbench.store import Store


def test_rows_that_share_a_reference_stand_together() -> None:
    rows = [some_row("a"), some_row("b", light="lamp"), some_row("c"), some_row("d", scene_parameters={"height": 1.0})]
    assert [[row.method for row in group] for group in by_view(rows)] == [["a", "c"], ["b"], ["d"]]


def test_titles_show_only_parameters_that_differ() -> None:
    rows = [some_row("pcf", method_parameters={"resolution": r, "kernel": 3}) for r in (256, 512)]
    assert titles([*rows, some_row("esm")], some_run()) == ["pcf(resolution=256)", "pcf(resolution=512)", "esm"]


def test_titles_of_equal_methods_are_told_apart_by_threads() -> None:
    rows = [some_row("pcf", threads=1), some_row("pcf", threads=2), some_row("esm", threads=2)]
    assert titles(rows, some_run()) == ["pcf, threads: 1", "pcf, threads: 2", "esm"]


def test_samples_and_layers_make_a_view_of_their_own() -> None:
    assert len(by_view([some_row(), some_row(pixel_samples=4, layers=8)])) == 2


def test_the_reference_is_that_of_the_first_case_that_has_one(store: Store) -> None:
    rows = [some_row("a", outcome="error"), with_pictures(store, some_row("b")), with_pictures(store, some_row("c"))]
    pool = PicturePool(store.artifact)
    (view,) = scene_views(some_run(), rows, pool)
    assert view.reference_file == rows[1].artifacts["reference"]
    assert [card.result > 0 for card in view.cards] == [False, True, True]
    assert len(pool.encode().addresses) == 3  # one reference, two results
