"""Pictures inside the page, and the bytes they may take."""

from __future__ import annotations

import base64
import io

import pytest
from PIL import Image
from stored_rows import mask_png, png

from shadowbench.errors import StoreError
from shadowbench.report.embedding import LADDER, SMALLEST_FURTHER, PicturePool, Priority


def decoded(address: str) -> Image.Image:
    return Image.open(io.BytesIO(base64.b64decode(address.partition(";base64,")[2])))


def embedded(content: bytes, byte_budget: int = 1_000_000) -> Image.Image:
    pool = PicturePool(lambda name: content, byte_budget)
    return decoded(_only(pool))


def _only(pool: PicturePool) -> str:
    pool.picture("a", Priority.RESULT)
    (address,) = pool.encode().addresses.values()
    return address


def test_large_picture_is_reduced_to_the_first_rung() -> None:
    assert embedded(png(1, size=(1280, 720))).size == (640, 360)


def test_small_picture_keeps_its_size() -> None:
    assert embedded(png(1)).size == (64, 48)


def test_what_is_asked_for_twice_is_read_and_embedded_once() -> None:
    read: list[str] = []

    def reading(name: str) -> bytes:
        read.append(name)
        return png(1)

    pool = PicturePool(reading, 100_000)
    assert pool.picture("a", Priority.FURTHER) == pool.picture("a", Priority.RESULT)
    assert len(pool.encode().addresses) == 1
    assert read == ["a"]


def test_picture_gets_smaller_until_it_fits_its_share() -> None:
    content = png(1, size=(1280, 960))
    assert embedded(content).width == LADDER[0][0]
    pool = PicturePool(lambda name: content, 50_000)
    address = _only(pool)
    assert len(address) < 4 / 3 * 50_000
    assert decoded(address).width in [width for width, _ in LADDER[1:]]


def test_that_pictures_were_made_smaller_is_told() -> None:
    content = png(1, size=(1280, 960))
    pool = PicturePool(lambda name: content, 50_000)
    pool.picture("a", Priority.RESULT)
    assert 0 < pool.encode().reduced_to < LADDER[0][0]
    generous = PicturePool(lambda name: content)
    generous.picture("a", Priority.RESULT)
    assert generous.encode().reduced_to == 0


def test_shares_follow_what_is_left() -> None:
    contents = {"light": png(1, size=(64, 48)), **dict.fromkeys("abc", png(2, size=(1280, 960)))}
    pool = PicturePool(contents.__getitem__, 260_000)
    numbers = [pool.picture(name, Priority.RESULT) for name in ("light", "a", "b", "c")]
    addresses = pool.encode().addresses
    widths = [decoded(addresses[number]).width for number in numbers]
    assert widths[0] == 64
    assert all(200 < width < 640 for width in widths[1:])


def test_further_pictures_are_left_out_before_results_suffer() -> None:
    content = png(1, size=(1280, 960))
    pool = PicturePool(lambda name: content, 60_000)
    further = [pool.picture(f"further {k}", Priority.FURTHER) for k in range(100)]
    result = pool.picture("result", Priority.RESULT)
    found = pool.encode()
    assert result in found.addresses
    assert found.left_out
    assert set(further) == found.left_out | (found.addresses.keys() & set(further))
    assert min(further) in found.addresses  # the first asked for is the first served
    assert len(further) - len(found.left_out) <= 60_000 // SMALLEST_FURTHER


def test_masks_are_palette_pictures() -> None:
    pool = PicturePool({"lit": mask_png((3, 4)), "acne": mask_png((5, 6))}.__getitem__)
    number = pool.mask([("false_lit", "lit"), ("acne", "acne")])
    image = decoded(pool.encode().addresses[number])
    assert (image.format, image.mode, image.size) == ("PNG", "P", (64, 48))


@pytest.mark.parametrize("content", [b"", b"GIF89a", b"\x89PNG\r\n\x1a\n broken"])
def test_what_is_no_picture_is_lost(content: bytes) -> None:
    pool = PicturePool(lambda name: content)
    numbers = {pool.picture("a", Priority.RESULT), pool.mask([("acne", "b")])}
    found = pool.encode()
    assert (found.addresses, found.lost) == ({}, numbers)


def test_lost_artifact_is_told() -> None:
    def gone(name: str) -> bytes:
        raise StoreError(f"{name} is gone")

    pool = PicturePool(gone)
    number = pool.picture("a", Priority.REFERENCE)
    assert pool.encode().lost == {number}
