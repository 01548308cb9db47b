"""Rows put together by view, and what a card says."""

from __future__ import annotations

import shlex

from stored_rows import png, some_row, some_run, with_pictures

from shadowbench.experiment import parse_choice, parse_size
from shadowbench.report.cases import by_view, picture_count, reproduce_command, scene_views, titles
from shadowbench.report.embedding import Embedder
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


def test_stages_and_what_they_leave_add_up() -> None:
    row = some_row(build_ms=6.0, shade_ms=4.0, stages={"fill": 5.0, "look-up": 3.0})
    (view,) = scene_views(some_run(), [row], Embedder(lambda name: b"", picture_count=0, byte_budget=0))
    assert [(stage.name, stage.share) for stage in view.cards[0].stages] == [
        ("fill", 50.0),
        ("look-up", 30.0),
        ("not in any stage", 20.0),
    ]


def test_command_names_the_same_case_again() -> None:
    row = some_row(
        scene_parameters={"path": "a folder/with, commas.ply", "height": 0.1 + 0.2},
        method_parameters={"resolution": 512, "receiver_plane": True, "near": None},
    )
    words = shlex.split(reproduce_command(row))
    option = dict(zip(words[2::2], words[3::2], strict=True))
    scene, method = parse_choice(option["--scene"]), parse_choice(option["--method"])
    assert (scene.name, method.name) == (row.scene, row.method)
    assert scene.values == {"path": ("a folder/with, commas.ply",), "height": (repr(0.1 + 0.2),)}
    assert method.values == {"resolution": ("512",), "receiver_plane": ("true",)}
    assert parse_size(option["--size"]) == (row.width, row.height)
    assert (option["--light"], option["--camera"], option["--threads"]) == ("sun", "main", "2")


def test_samples_and_layers_make_a_view_of_their_own_and_are_part_of_the_command() -> None:
    one, four = some_row(), some_row(pixel_samples=4, layers=8)
    assert len(by_view([one, four])) == 2
    assert "--pixel-samples" not in reproduce_command(one)
    words = shlex.split(reproduce_command(four))
    assert words[words.index("--pixel-samples") + 1] == "4"
    assert words[words.index("--layers") + 1] == "8"


def test_pictures_that_a_method_drew_itself_are_shown_and_counted(store: Store) -> None:
    row = with_pictures(store, some_row())
    own = {"picture-BSP over the samples": store.put_artifact(png(7), "png")}
    row = row.model_copy(update={"artifacts": row.artifacts | own})
    assert picture_count([row]) == 4
    (view,) = scene_views(some_run(), [row], Embedder(store.artifact, picture_count=4, byte_budget=1_000_000))
    ((name, picture),) = view.cards[0].further_pictures
    assert name == "BSP over the samples"
    assert (picture.width, picture.height) == (64, 48)


def test_the_filtered_reference_and_the_error_against_it_are_shown_and_measured(store: Store) -> None:
    row = with_pictures(store, some_row(rmse=0.05, leak_p99=0.2))
    more = {name: store.put_artifact(png(seed), "png") for seed, name in ((8, "filtered-reference"), (9, "error"))}
    row = row.model_copy(update={"artifacts": row.artifacts | more})
    assert picture_count([row]) == 5
    (view,) = scene_views(some_run(), [row], Embedder(store.artifact, picture_count=5, byte_budget=1_000_000))
    names = [name for name, _ in view.cards[0].further_pictures]
    assert names == [
        "reference, filtered with the method's kernel",
        "error against the filtered reference: blue is too dark, orange too lit",
    ]
    assert ("RMSE", "0.05000") in view.cards[0].headline
    measured = {name: value for name, value, _ in view.cards[0].measures}
    assert measured.items() >= {"RMSE": "0.05000", "leak 99th percentile": "0.2000"}.items()
