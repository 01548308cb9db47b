"""Pictures of a light's image plane: the depths of its map, where the visible samples lie, the structure over them.

NumPy and Pillow only, as :mod:`shadowbench.pictures`. A method's ``explain()`` draws them.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

SIDE = 1024
"""Width and height of the picture of one window [pixels]; six windows are drawn at half that, three side by side."""

SHEET_COLUMNS, CAPTION = 6, 26
"""Of a sheet of maps: side by side at most, and the height of the line under each [pixels]."""

POINTS_SHOWN = 12_288
"""About as many samples are drawn as points: 1 in 64 of 1024x768, as in Aila & Laine 2004, Figure 4."""

FACE_NAMES = ("+x", "-x", "+y", "-y", "+z", "-z")

_NEAREST_GREY, _GREY_SPAN = 24.0, 200.0
"""Greys of depths: from the nearest on, lighter by so much up to the farthest; empty is white."""

_LETTERS = 18
"""Height of letters on a sheet [pixels]: read at 640 pixels of the page, too."""

_PAPER, _LIT, _SHADOWED, _CELL, _FRAME = (255, 255, 255), (214, 137, 0), (24, 66, 130), (176, 176, 176), (90, 90, 90)


@dataclass(frozen=True, eq=False)
class LightPlane:
    """One window of a light.

    Attributes:
        number: Of the window; the cube's face where there are six.
        place: Samples' coordinates in [-1, 1], x to the right and y down, shape [n, 2].
        pixel: The pixel each of them is seen by, ``row * width + column``, shape [n].
        is_lit: Whether it is, bool, shape [n].
        cells: Boxes (low x, low y, high x, high y), shape [m, 4].
    """

    number: int
    place: NDArray[np.float32]
    pixel: NDArray[np.int32]
    is_lit: NDArray[np.bool_]
    cells: NDArray[np.float32]


def light_space_pictures(planes: Sequence[LightPlane], width: int, structure: str) -> dict[str, NDArray[np.uint8]]:
    """Return the pictures by name: the samples, lit ones orange and shadowed ones blue, and the structure over them.

    Args:
        planes: The light's windows that hold samples.
        width: Of the camera's picture [pixels].
        structure: What it is called.
    """
    if not planes:
        return {}
    step = max(1, round(math.sqrt(sum(len(p.place) for p in planes) / POINTS_SHOWN)))
    return {
        "samples in light space": _tiled(planes, width, step, with_cells=False),
        f"{structure} over the samples": _tiled(planes, width, step, with_cells=True),
    }


def _tiled(planes: Sequence[LightPlane], width: int, step: int, *, with_cells: bool) -> NDArray[np.uint8]:
    if len(planes) == 1 and planes[0].number == 0:
        return np.asarray(_drawn(planes[0], width, step, SIDE, with_cells=with_cells))
    return _cube_sheet({p.number: _drawn(p, width, step, SIDE // 2, with_cells=with_cells) for p in planes})


def _cube_sheet(faces: Mapping[int, Image.Image]) -> NDArray[np.uint8]:
    """Return a cube's faces, ``SIDE / 2`` wide each, with their names: three side by side, opposite ones below."""
    side = SIDE // 2
    sheet = Image.new("RGB", (3 * side, 2 * side), _PAPER)
    for number, name in enumerate(FACE_NAMES):
        corner = (number // 2 * side, number % 2 * side)
        if number in faces:
            sheet.paste(faces[number], corner)
        draw = ImageDraw.Draw(sheet)
        draw.rectangle((*corner, corner[0] + side - 1, corner[1] + side - 1), outline=_FRAME)
        draw.text((corner[0] + 6, corner[1] + 4), name, fill=_FRAME)
    return np.asarray(sheet)


def _drawn(plane: LightPlane, width: int, step: int, side: int, *, with_cells: bool) -> Image.Image:
    image = Image.new("RGB", (side, side), _PAPER)
    if with_cells:
        draw = ImageDraw.Draw(image)
        for box in np.clip((plane.cells.astype(np.float64) + 1.0) * (0.5 * side), 0.0, side - 1.0).round().astype(int):
            draw.rectangle(tuple(int(edge) for edge in box), outline=_CELL)
    pixels = np.array(image)
    # every step-th pixel of every step-th row: an even share of the picture, whatever the structure's order
    row, column = np.divmod(plane.pixel, width)
    shown = (row % step == step // 2) & (column % step == step // 2)
    at = ((plane.place[shown].astype(np.float64) + 1.0) * (0.5 * side)).astype(int)
    colours = np.where(plane.is_lit[shown, None], np.array(_LIT), np.array(_SHADOWED)).astype(np.uint8)
    for down in (0, 1):
        for right in (0, 1):
            x, y = (np.clip(at[:, axis] + moved, 0, side - 1) for axis, moved in ((0, right), (1, down)))
            pixels[y, x] = colours
    return Image.fromarray(pixels)


def depth_sheet(maps: Sequence[tuple[str, NDArray[np.float32]]], *, left_out: int = 0) -> NDArray[np.uint8]:
    """Return depth maps of many windows side by side, each with greys over its own depths and its name under it.

    Args:
        maps: Names and linear depths, 1 for an empty texel, shape [row, column]; one at least.
        left_out: How many there are besides, said under the last.
    """
    columns = min(SHEET_COLUMNS, max(2, math.ceil(math.sqrt(len(maps)))))
    side = SIDE // columns
    rows = -(-len(maps) // columns)
    width = SIDE if rows > 1 else len(maps) * side
    sheet = Image.new("RGB", (width, rows * (side + CAPTION) + (CAPTION if left_out else 0)), _PAPER)
    draw = ImageDraw.Draw(sheet)
    for number, (name, depth) in enumerate(maps):
        left, top = number % columns * side, number // columns * (side + CAPTION)
        sheet.paste(_grey(depth, side, *_limits(depth)), (left, top))
        draw.rectangle((left, top, left + side - 1, top + side - 1), outline=_FRAME)
        draw.text((left + 4, top + side + 2), _fitted(draw, name, side - 8), fill=_FRAME, font_size=_LETTERS)
    if left_out:
        text = f"and {left_out} more map{'s' if left_out > 1 else ''}"
        draw.text((4, rows * (side + CAPTION) + 2), text, fill=_FRAME, font_size=_LETTERS)
    return np.asarray(sheet)


def _fitted(draw: ImageDraw.ImageDraw, text: str, width: int) -> str:
    """Return a text, shortened in its middle where it is wider than there is room."""

    def wide(shown: str) -> float:
        return draw.textlength(shown, font_size=_LETTERS)

    def cut(kept: int) -> str:
        return f"{text[:kept]}\u2026{text[len(text) - kept :]}"

    if len(text) < 3 or wide(text) <= width:
        return text
    fitting = bisect_right(range(1, (len(text) + 1) // 2), float(width), key=lambda kept: wide(cut(kept)))
    return cut(max(1, fitting))


def depth_picture(depth: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Return the picture of depth maps: what is near is dark, what is far is light, white where nothing was drawn.

    Greys are spread over the depths that occur. Of texels that share a pixel the nearest is shown, so that a twig
    stays; six maps stand as a cube's faces do in :func:`light_space_pictures`.

    Args:
        depth: Linear depths in [0, 1], 1 for an empty texel, shape [face, row, column].
    """
    limits = _limits(depth)
    side = SIDE if len(depth) == 1 else SIDE // 2
    pictures = [_grey(each, side, *limits) for each in depth]
    return np.asarray(pictures[0].convert("RGB")) if len(pictures) == 1 else _cube_sheet(dict(enumerate(pictures)))


def _limits(depth: NDArray[np.float32]) -> tuple[float, float]:
    """Return the nearest and the farthest depth that was drawn."""
    drawn = depth[depth < 1.0]
    return (float(drawn.min()), float(drawn.max())) if drawn.size else (0.0, 1.0)


def _grey(depth: NDArray[np.float32], side: int, near: float, far: float) -> Image.Image:
    """Return the picture of one map."""
    texels = _nearest_within(depth, side)
    share = (texels - near) / max(far - near, 1.0e-6)
    grey = np.where(texels < 1.0, _NEAREST_GREY + 0.5 + share * _GREY_SPAN, 255.0).astype(np.uint8)
    return Image.fromarray(grey).resize((side, side), Image.Resampling.NEAREST)


def _nearest_within(depth: NDArray[np.float32], side: int) -> NDArray[np.float64]:
    """Return a map of at most ``side`` texels along each axis, the nearest depth in each block."""
    step = -(-len(depth) // side)
    starts = np.arange(0, len(depth), step)
    return np.minimum.reduceat(np.minimum.reduceat(depth, starts, axis=0), starts, axis=1).astype(np.float64)
