"""Failure masks as one small palette PNG a case, in which the page's script switches classes on and off.

A pixel's index says what fails in it: ``kind + 5 * classified``, where kind is 0 for nothing or the place of its class
in :data:`KINDS`. Peter-panning is false lit and acne is false shadow, so a pixel has one kind; where receivers of one
pixel differ, the later kind is shown. The palette is what all classes together look like; the script rewrites it.
When a mask is reduced, a pixel fails if *any* of the pixels it stands for does: a thin line of failures stays.
"""

from __future__ import annotations

import io
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from shadowbench.pictures import FAILURE_COLOURS

KINDS = ("false_lit", "peter_panning", "false_shadow", "acne")
"""Classes of failures by measurement, in the order of their indices from 1 on."""

CLASSIFIED = "classified"
"""The class of failures by the method's own test; painted below the others."""

PART_OF = {"peter_panning": "false_lit", "acne": "false_shadow"}
"""A class that is part of another one: its pixels are that one's where it is switched off itself."""

_CLASSIFIED_STEP = len(KINDS) + 1


def palette_png(masks: Mapping[str, Image.Image], size: tuple[int, int]) -> bytes:
    """Return the masks of one case as a palette PNG.

    Args:
        masks: Failure class -> 1-bit picture, all of one size.
        size: Width and height of the result [pixels], at most those of the masks.
    """
    index = np.zeros(size[::-1], dtype=np.uint8)
    for number, name in enumerate(KINDS, 1):
        if name in masks:
            index[_reduced(masks[name], size)] = number
    if CLASSIFIED in masks:
        index[_reduced(masks[CLASSIFIED], size)] += _CLASSIFIED_STEP
    image = Image.fromarray(index)
    image.putpalette([channel for colour in palette() for channel in colour], "RGB")
    file = io.BytesIO()
    opaque = bytes([0, *[255] * (2 * _CLASSIFIED_STEP - 1)])
    image.save(file, format="PNG", bits=4, transparency=opaque, optimize=True)
    return file.getvalue()


def palette() -> list[tuple[int, int, int]]:
    """Return the colour of every index with all classes switched on; index 0 is transparent."""
    kinds = [FAILURE_COLOURS[name] for name in KINDS]
    return [(0, 0, 0), *kinds, FAILURE_COLOURS[CLASSIFIED], *kinds]


def _reduced(mask: Image.Image, size: tuple[int, int]) -> NDArray[np.bool_]:
    pixels = np.asarray(mask.convert("1"))
    for axis, (length, reduced) in enumerate(zip(pixels.shape, size[::-1], strict=True)):
        if length != reduced:
            begins = -(-np.arange(reduced) * length // reduced)  # of the pixels that each one stands for
            pixels = np.logical_or.reduceat(pixels, begins, axis=axis)
    return pixels
