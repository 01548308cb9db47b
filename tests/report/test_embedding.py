"""Pictures inside the page."""

from __future__ import annotations

import base64
import io

import numpy as np
import pytest
from PIL import Image
from stored_rows import png

from shadowbench.errors import StoreError
from shadowbench.report.embedding import LADDER, Embedded, Embedder, reduced_mask

ORANGE = (230, 159, 0)


def decoded(picture: Embedded | None) -> Image.Image:
    assert picture is not None
    return Image.open(io.BytesIO(base64.b64decode(picture.address.removeprefix("data:image/webp;base64,"))))


def embedder_of(content: bytes, **options: int) -> Embedder:
    return Embedder(lambda name: content, **({"picture_count": 1, "byte_budget": 1_000_000} | options))


def test_large_picture_is_reduced_to_the_first_rung() -> None:
    picture = embedder_of(png(1, size=(1280, 720))).picture("a")
    assert decoded(picture).size == (640, 360)
    assert picture is not None
    assert (picture.width, picture.height) == (640, 360)


def test_small_picture_keeps_its_size() -> None:
    assert decoded(embedder_of(png(1)).picture("a")).size == (64, 48)


def test_every_artifact_is_read_once() -> None:
    read: list[str] = []

    def reading(name: str) -> bytes:
        read.append(name)
        return png(1)

    embedder = Embedder(reading, picture_count=2, byte_budget=100_000)
    assert embedder.picture("a") is embedder.picture("a")
    assert read == ["a"]


def test_picture_gets_smaller_until_it_fits_its_share() -> None:
    content = png(1, size=(1280, 960))
    generous, frugal = embedder_of(content).picture("a"), embedder_of(content, byte_budget=40_000).picture("a")
    assert decoded(generous).width == LADDER[0][0]
    assert frugal is not None
    assert len(frugal.address) < 4 / 3 * 40_000 + 100
    assert decoded(frugal).width in [width for width, _ in LADDER[1:]]


def test_shares_follow_what_is_left() -> None:
    light, heavy = png(1, size=(64, 48)), png(2, size=(1280, 960))
    contents = {"light": light, **dict.fromkeys("abc", heavy)}
    embedder = Embedder(contents.__getitem__, picture_count=4, byte_budget=260_000)
    widths = [decoded(embedder.picture(name)).width for name in ("light", "a", "b", "c")]
    assert widths[0] == 64
    assert set(widths[1:]) <= {480, 320}


@pytest.mark.parametrize("size", [(64, 48), (40, 30), (1, 1)])
def test_reduced_mask_keeps_a_single_painted_pixel(size: tuple[int, int]) -> None:
    mask = reduced_mask(Image.open(io.BytesIO(png(1, painted=(20, 10)))), size)
    painted = np.argwhere((np.asarray(mask) == ORANGE).all(axis=2))
    assert painted.tolist() == [[20 * size[1] // 48, 10 * size[0] // 64]]


def test_mask_colours_survive_exactly() -> None:
    mask = np.asarray(decoded(embedder_of(png(1, painted=(20, 10))).mask("a")).convert("RGB"))
    assert tuple(mask[20, 10]) == ORANGE


@pytest.mark.parametrize("content", [b"", b"GIF89a", b"\x89PNG\r\n\x1a\n broken"])
def test_what_is_no_picture_gives_none(content: bytes) -> None:
    assert embedder_of(content).picture("a") is None


def test_lost_artifact_gives_none() -> None:
    def lost(name: str) -> bytes:
        raise StoreError(f"{name} is gone")

    assert Embedder(lost, picture_count=1, byte_budget=1000).mask("a") is None
