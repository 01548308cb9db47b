"""Visibilities from files: every format gives the numbers that were written, and what does not fit is refused."""

from __future__ import annotations

import struct
import zlib
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from builders import box_over_ground
from numpy.typing import NDArray
from opened_views import opened
from PIL import Image

from shadowbench.errors import UsageError
from shadowbench.inspection.visibility_files import read_visibility
from shadowbench.receivers import Receivers

OpenEXR = pytest.importorskip("OpenEXR")


@cache
def _receivers() -> Receivers:
    return opened(box_over_ground(), pixel_samples=2).receivers


def _picture() -> NDArray[np.float32]:
    return np.random.default_rng(7).random((36, 48), dtype=np.float32)


def _write_exr(path: Path, channels: dict[str, NDArray[np.float32]]) -> None:
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    with OpenEXR.File(header, channels) as file:
        file.write(str(path))


def test_a_picture_gives_each_receiver_its_pixels_value(tmp_path: Path) -> None:
    picture, receivers = _picture(), _receivers()
    np.save(tmp_path / "a.npy", picture)
    _write_exr(tmp_path / "a.exr", {"Y": picture})
    Image.fromarray(np.rint(picture * 65535).astype(np.uint16)).save(tmp_path / "sixteen.png")
    Image.fromarray(np.rint(picture * 255).astype(np.uint8)).save(tmp_path / "eight.png")
    expected = picture.reshape(-1)[receivers.pixel]
    for name, tolerance in (("a.npy", 0.0), ("a.exr", 0.0), ("sixteen.png", 0.6 / 65535), ("eight.png", 0.6 / 255)):
        found = read_visibility(tmp_path / name, receivers, channels=1)
        assert found.dtype == np.float32
        assert found.shape == (receivers.count,)
        assert np.abs(found - expected).max() <= tolerance


def test_a_list_gives_each_receiver_its_own(tmp_path: Path) -> None:
    receivers = _receivers()
    values = np.random.default_rng(1).random((receivers.count, 3))
    np.save(tmp_path / "list.npy", values)
    assert np.array_equal(read_visibility(tmp_path / "list.npy", receivers, channels=3), values.astype(np.float32))
    np.save(tmp_path / "bool.npy", values[:, 0] > 0.5)
    assert np.array_equal(read_visibility(tmp_path / "bool.npy", receivers, channels=1), values[:, 0] > 0.5)


def test_colours_are_kept_where_casters_have_them_and_grey_stands_for_three(tmp_path: Path) -> None:
    receivers, picture = _receivers(), _picture()
    colours = np.stack([picture, picture**2, 1.0 - picture], axis=-1)
    _write_exr(tmp_path / "colour.exr", {name: np.ascontiguousarray(colours[..., k]) for k, name in enumerate("RGB")})
    found = read_visibility(tmp_path / "colour.exr", receivers, channels=3)
    assert np.array_equal(found, colours.reshape(-1, 3)[receivers.pixel])
    np.save(tmp_path / "grey.npy", picture)
    assert read_visibility(tmp_path / "grey.npy", receivers, channels=3).shape == (receivers.count, 3)
    np.save(tmp_path / "same.npy", np.repeat(picture[..., None], 3, axis=2))
    assert read_visibility(tmp_path / "same.npy", receivers, channels=1).shape == (receivers.count,)
    with pytest.raises(UsageError, match="coloured"):
        read_visibility(tmp_path / "colour.exr", receivers, channels=1)


def test_what_no_receiver_sees_may_hold_anything(tmp_path: Path) -> None:
    receivers, picture = _receivers(), _picture()
    sky = np.ones(picture.size, bool)
    sky[receivers.pixel] = False
    assert sky.any()
    picture.reshape(-1)[sky] = np.nan
    np.save(tmp_path / "a.npy", picture)
    assert np.isfinite(read_visibility(tmp_path / "a.npy", receivers, channels=1)).all()


def _spoilt(value: float) -> NDArray[np.float32]:
    picture = _picture()
    picture.reshape(-1)[_receivers().pixel[5]] = value
    return picture


@pytest.mark.parametrize(
    ("array", "message"),
    [
        (_picture()[:, :47], "36 x 47"),
        (_picture().T, "48 x 36"),
        (_picture().reshape(-1), "1728"),
        (_picture()[..., None].repeat(2, axis=2), "2 channels"),
        (np.float32(1.0), "a single value"),
        (_picture() * 200.0, "outside"),
        ((_picture() * 255).astype(np.uint8), "integers up to 25"),
        (_picture().astype(complex), "complex128"),
        (_picture().astype("U4"), "numbers from 0 to 1"),
    ],
    ids=str,
)
def test_arrays_that_do_not_fit_are_refused(array: NDArray[np.float32], message: str, tmp_path: Path) -> None:
    np.save(tmp_path / "a.npy", array)
    with pytest.raises(UsageError, match=message):
        read_visibility(tmp_path / "a.npy", _receivers(), channels=1)


@pytest.mark.parametrize("value", [np.nan, np.inf, -0.01, 1.5])
def test_the_first_wrong_pixel_is_named(value: float, tmp_path: Path) -> None:
    np.save(tmp_path / "a.npy", _spoilt(value))
    pixel = int(_receivers().pixel[5])
    with pytest.raises(UsageError, match=f"first at pixel {pixel % 48},{pixel // 48}"):
        read_visibility(tmp_path / "a.npy", _receivers(), channels=1)


def test_a_rounding_beyond_one_is_clipped(tmp_path: Path) -> None:
    np.save(tmp_path / "a.npy", np.full((36, 48), 1.000002, np.float32))
    assert (read_visibility(tmp_path / "a.npy", _receivers(), channels=1) == 1.0).all()


def test_pickles_are_never_opened(tmp_path: Path) -> None:
    np.save(tmp_path / "a.npy", np.array([{"a": 1}], dtype=object), allow_pickle=True)
    with pytest.raises(UsageError, match="NumPy array"):
        read_visibility(tmp_path / "a.npy", _receivers(), channels=1)


def _png_header(width: int, height: int) -> bytes:
    """A PNG that promises a size and holds nothing."""
    body = struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)
    chunk = b"IHDR" + body
    return (
        b"\x89PNG\r\n\x1a\n" + struct.pack(">I", 13) + chunk + struct.pack(">I", zlib.crc32(chunk))
        + struct.pack(">I", 0) + b"IEND" + struct.pack(">I", zlib.crc32(b"IEND"))
    )  # fmt: skip


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("bomb.png", _png_header(60000, 60000), "60000"),
        ("empty.png", _png_header(48, 36), "PNG"),
        ("text.png", b"no picture", "not a PNG"),
        ("text.exr", b"no picture", "OpenEXR"),
        ("text.npy", b"no array", "NumPy"),
        ("empty.npy", b"", "NumPy"),
        ("a.jpg", b"", ".npy, .exr or .png"),
    ],
)
def test_files_that_are_not_what_they_say_are_one_line(name: str, content: bytes, message: str, tmp_path: Path) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(UsageError, match=message) as caught:
        read_visibility(tmp_path / name, _receivers(), channels=1)
    assert "\n" not in str(caught.value)


def test_palettes_and_alpha_are_refused(tmp_path: Path) -> None:
    grey = Image.fromarray(np.rint(_picture() * 255).astype(np.uint8))
    for mode in ("P", "LA", "RGBA"):
        grey.convert(mode).save(tmp_path / "a.png")
        with pytest.raises(UsageError, match="no palette and no alpha"):
            read_visibility(tmp_path / "a.png", _receivers(), channels=1)


def test_a_file_that_is_not_there_is_said_to_be_so(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="does not exist"):
        read_visibility(tmp_path / "a.npy", _receivers(), channels=1)
