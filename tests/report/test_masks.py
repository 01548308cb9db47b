"""Failure masks as palette pictures."""

from __future__ import annotations

import io

import numpy as np
import pytest
from PIL import Image
from stored_rows import mask_png

from shadowbench.pictures import FAILURE_COLOURS
from shadowbench.report.masks import KINDS, PART_OF, palette, palette_png

SIZE = (64, 48)


def masks(**painted: tuple[int, int]) -> dict[str, Image.Image]:
    return {name: Image.open(io.BytesIO(mask_png(at))) for name, at in painted.items()}


def opened(content: bytes) -> Image.Image:
    return Image.open(io.BytesIO(content))


def test_a_class_is_shown_in_its_colour_and_nothing_else_is_painted() -> None:
    shown = np.asarray(opened(palette_png(masks(**dict.fromkeys(["acne"], (20, 10))), SIZE)).convert("RGBA"))
    assert tuple(shown[20, 10]) == (*FAILURE_COLOURS["acne"], 255)
    assert np.count_nonzero(shown[..., 3]) == 1


def test_a_part_lies_over_its_whole_and_failures_over_what_a_method_suspects() -> None:
    at = (5, 6)
    found = opened(palette_png(masks(false_lit=at, peter_panning=at, classified=at), SIZE))
    index = np.asarray(found)[at]
    assert palette()[index] == FAILURE_COLOURS["peter_panning"]
    alone = opened(palette_png(masks(classified=at), SIZE))
    assert palette()[np.asarray(alone)[at]] == FAILURE_COLOURS["classified"]
    assert index == np.asarray(alone)[at] + 1 + KINDS.index("peter_panning")


@pytest.mark.parametrize("size", [SIZE, (40, 30), (1, 1)])
def test_a_reduced_mask_keeps_a_single_painted_pixel(size: tuple[int, int]) -> None:
    found = np.argwhere(np.asarray(opened(palette_png(masks(false_shadow=(20, 10)), size))))
    assert found.tolist() == [[20 * size[1] // 48, 10 * size[0] // 64]]


def test_the_file_has_four_bits_a_pixel() -> None:
    content = palette_png(masks(acne=(1, 1)), SIZE)
    assert content[24:26] == bytes([4, 3])  # IHDR: bit depth, palette


def test_every_kind_but_the_wholes_is_part_of_a_kind() -> None:
    assert {name for name in KINDS if name not in PART_OF} == {"false_lit", "false_shadow"}
    assert set(PART_OF.values()) <= set(KINDS)
