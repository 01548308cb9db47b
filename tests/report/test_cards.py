"""What a card says."""

from __future__ import annotations

import json
import shlex

from stored_rows import png, some_row, some_run, with_masks, with_pictures

from shadowbench.experiment import parse_choice, parse_size
from shadowbench.report.cards import Card, Section, card_of, reproduce_command
from shadowbench.report.embedding import PicturePool
from shadowbench.rows import RATIOS, ResultRow
from shadowbench.store import Store
from shadowbench.tables.verdicts import Verdicts


def card(row: ResultRow, pool: PicturePool | None = None) -> Card:
    return card_of(some_run(), row, row.method, "view-1-case-1", pool or PicturePool(lambda name: b""))


def section(found: Card, title: str) -> Section:
    return next(section for section in found.sections if section.title == title)


def test_stages_and_what_they_leave_add_up() -> None:
    found = card(some_row(build_ms=6.0, shade_ms=4.0, stages={"fill": 5.0, "look-up": 3.0}))
    assert section(found, "Stages").lines == [
        ("fill", "5.00 ms", "50.0 %"),
        ("look-up", "3.00 ms", "30.0 %"),
        ("not in any stage", "2.00 ms", "20.0 %"),
    ]


def test_sections_without_lines_are_left_out() -> None:
    assert [found.title for found in card(some_row(outcome="error")).sections] == ["Parameters", "Measured"]


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


def test_samples_and_layers_are_part_of_the_command() -> None:
    assert "--pixel-samples" not in reproduce_command(some_row())
    words = shlex.split(reproduce_command(some_row(pixel_samples=4, layers=8)))
    assert words[words.index("--pixel-samples") + 1] == "4"
    assert words[words.index("--layers") + 1] == "8"


def test_pictures_that_a_method_drew_itself_are_layers_and_files(store: Store) -> None:
    row = with_pictures(store, some_row())
    own = {"picture-BSP over the samples": store.put_artifact(png(7), "png")}
    row = row.model_copy(update={"artifacts": row.artifacts | own})
    pool = PicturePool(store.artifact)
    found = card(row, pool)
    ((name, number),) = found.layers
    assert name == "BSP over the samples"
    assert pool.encode().addresses[number].startswith("data:image/webp;base64,")
    assert [name for name, _ in found.files] == ["result", "failures", "picture-BSP over the samples"]


def test_the_filtered_reference_and_the_error_against_it_are_layers_and_measured(store: Store) -> None:
    row = with_pictures(store, some_row(rmse=0.05, leak_p99=0.2))
    more = {name: store.put_artifact(png(seed), "png") for seed, name in ((8, "filtered-reference"), (9, "error"))}
    found = card(row.model_copy(update={"artifacts": row.artifacts | more}), PicturePool(store.artifact))
    assert [name for name, _ in found.layers] == ["filtered reference", "error: blue too dark, orange too lit"]
    assert ("RMSE", "0.05000") in found.headline
    measured = {line[0]: line[1] for line in section(found, "Quality").lines}
    assert measured.items() >= {"RMSE": "0.05000", "leak 99th percentile": "0.2000"}.items()


def test_masks_of_classes_that_hold_nothing_are_not_asked_for(store: Store) -> None:
    row = with_masks(store, some_row(), false_lit=(1, 2), acne=(3, 4))
    assert card(row).classes == ["false_lit", "acne"]
    none = row.model_copy(update={"false_lit_count": 0, "acne_count": 0})
    assert (card(none).mask, card(none).classes) == (0, [])


def test_what_travels_as_json_has_its_control_characters_made_visible() -> None:
    hostile = "</script>\x1b[31m\u202e"
    row = some_row(hostile, outcome="error", reason=hostile, stderr_tail=hostile, method_parameters={hostile: hostile})
    text = json.dumps(card(row).as_json(), ensure_ascii=False)
    assert "\x1b" not in text
    assert "\u202e" not in text
    assert "\\\\x1b[31m" in text


def test_a_card_says_how_its_times_were_taken() -> None:
    row = some_row(
        rounds=20,
        processes=4,
        ended_by="interval",
        warm_up_frames=3,
        build_repeats=5,
        shade_repeats=1,
        outlier_rounds=[6],
        stages={"draw": 0.75},
        unexplained_ms=0.25,
    )
    facts = dict(fact[:2] for fact in section(card(row), "Measured").lines)
    assert facts["rounds"] == "20, in 4 processes"
    assert facts["ended by"] == "the intervals: all are tight"
    assert facts["one sample"] == "5 builds, 1 shade; after 3 frames to warm up"
    assert facts["outliers"] == "round 7"
    assert section(card(row), "Stages").lines[-1] == ("not in any stage", "0.250 ms", "10.0 %")


def test_a_card_sets_its_times_beside_the_first_cases() -> None:
    times = [1.0 + 0.01 * number for number in range(12)]
    samples = {"build": times, "shade": times, "camera": times}
    first = some_row("ray-traced", comparison="c", samples=samples)
    first.baseline_case = first.case_key
    twice = {name: [2.0 * value for value in values] for name, values in samples.items()}
    row = some_row(comparison="c", samples=twice, baseline_case=first.case_key)
    verdicts = Verdicts([first, row], [first, row], RATIOS)
    found = card_of(some_run(), row, "pcf", "a", PicturePool(lambda name: b""), verdicts)
    against = section(found, "Against the first case").lines
    assert ("shade", "[2.00, 2.00, 2.00]", "slower") in against
    assert len(against) == 5
    other = card_of(some_run(), first, "ray-traced", "b", PicturePool(lambda name: b""), verdicts)
    assert all(each.title != "Against the first case" for each in other.sections)
