"""Visibilities made elsewhere, from files: NumPy arrays, OpenEXR and PNG pictures, held to a view before they count.

A file holds a value per receiver [n] or per pixel [height, width], with a last axis of 3 where casters have a coloured
transmittance. Values are linear: 1 lit, 0 shadowed. A PNG's are v/255, or v/65535 with 16 bits; no transfer curve is
undone, whatever the file says of one.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shadowbench.errors import UsageError
from shadowbench.receivers import Receivers

ROUNDING = 1.0e-5
"""A value outside [0, 1] by no more is taken for rounding."""

_MOST_CHANNELS = 4


def read_visibility(path: Path, receivers: Receivers, *, channels: int) -> NDArray[np.float32]:
    """Return a file's visibility per receiver.

    Args:
        path: A .npy, .exr or .png file.
        receivers: Whom it is for.
        channels: 1, or 3 where casters have a coloured transmittance.

    Returns:
        float32, shape [n] or [n, 3]; 0 at receivers that are not valid.

    Raises:
        UsageError: The file cannot be read or does not fit; the message says what would.
    """
    readers: dict[str, Callable[[Path, Receivers], NDArray[Any]]] = {".npy": _npy, ".exr": _exr, ".png": _png}
    reader = readers.get(path.suffix.lower())
    if reader is None:
        raise UsageError(f"{path}: a visibility is a .npy, .exr or .png file")
    if not path.is_file():
        raise UsageError(f"{path}: {'is no file' if path.exists() else 'does not exist'}")
    by_receiver = _per_receiver(path, reader(path, receivers), receivers)
    return _checked(path, _with_channels(path, by_receiver, channels), receivers)


def _npy(path: Path, receivers: Receivers) -> NDArray[Any]:
    try:
        values = np.load(path, mmap_mode="r", allow_pickle=False)  # only the header is read yet
    except (OSError, ValueError, EOFError) as error:
        raise UsageError(f"{path}: is not a NumPy array: {_line(error)}") from None
    if not isinstance(values, np.ndarray):
        raise UsageError(f"{path}: is not a single NumPy array")
    _must_fit(path, values.shape, receivers)
    if values.dtype.kind in "iu" and values.size and (values.min() < 0 or values.max() > 1):
        raise UsageError(f"{path}: holds integers up to {values.max()}; write floats from 0 to 1")
    if values.dtype.kind not in "biuf":
        raise UsageError(f"{path}: holds {values.dtype}, not numbers from 0 to 1")
    return values


def _png(path: Path, receivers: Receivers) -> NDArray[Any]:
    from PIL import Image, UnidentifiedImageError

    try:
        with Image.open(path, formats=["PNG"]) as image:
            _must_fit(path, (image.height, image.width), receivers)  # before a byte of it is unpacked
            if image.mode not in ("1", "L", "RGB", "I;16", "I;16B", "I"):
                raise UsageError(
                    f"{path}: is a PNG of mode {image.mode}; write grey or RGB, 8 or 16 bits, no palette and no alpha"
                )
            values = np.asarray(image)
    except UnidentifiedImageError:
        raise UsageError(f"{path}: is not a PNG picture") from None
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError) as error:
        raise UsageError(f"{path}: cannot be read as PNG: {_line(error)}") from None
    if values.dtype == bool:
        return values
    return values.astype(np.float32) / np.float32(255.0 if values.dtype == np.uint8 else 65535.0)


def _exr(path: Path, receivers: Receivers) -> NDArray[Any]:
    try:
        import OpenEXR
    except ImportError:
        raise UsageError(f"{path}: reading OpenEXR needs an extra: pip install 'shadowbench[exr]'") from None
    try:
        with OpenEXR.File(str(path), header_only=True) as file:
            low, high = (np.asarray(corner) for corner in file.header()["dataWindow"])
        width, height = (high - low + 1).tolist()
        _must_fit(path, (height, width), receivers)
        with OpenEXR.File(str(path), separate_channels=True) as file:
            found = {name: np.asarray(channel.pixels) for name, channel in file.channels().items()}
    except UsageError:
        raise
    except Exception as error:  # noqa: BLE001 - the library raises several kinds
        raise UsageError(f"{path}: cannot be read as OpenEXR: {_line(error)}") from None
    names = ["R", "G", "B"] if {"R", "G", "B"} <= found.keys() else [name for name in found if name != "A"]
    if len(names) not in (1, 3):
        raise UsageError(f"{path}: has the channels {', '.join(sorted(found))}; write one, or R, G and B")
    values = np.stack([found[name].astype(np.float32) for name in names], axis=-1)
    return values[..., 0] if len(names) == 1 else values


def _must_fit(path: Path, shape: tuple[int, ...], receivers: Receivers) -> None:
    """Raise unless a shape is that of a picture, or of a list of receivers."""
    height, width, count = receivers.height, receivers.width, receivers.count
    is_picture = shape[:2] == (height, width) and len(shape) in (2, 3)
    is_list = shape[:1] == (count,) and (len(shape) == 1 or (len(shape) == 2 and shape[1] <= _MOST_CHANNELS))
    if not (is_picture or is_list):
        found = " x ".join(map(str, shape)) or "a single value"
        raise UsageError(
            f"{path}: is {found}, but the view has {height} x {width} pixels (rows x columns) and {count} receivers"
        )


def _per_receiver(path: Path, values: NDArray[Any], receivers: Receivers) -> NDArray[np.float32]:
    """Return values [n, channels]."""
    is_list = values.shape[0] == receivers.count and (
        values.ndim == 1 or values.shape[:2] != (receivers.height, receivers.width)
    )
    if not is_list:
        values = values.reshape(receivers.width * receivers.height, -1)[receivers.pixel]
    found = values.reshape(receivers.count, -1).astype(np.float32)
    if found.shape[1] not in (1, 3):
        raise UsageError(f"{path}: has {found.shape[1]} channels; a visibility has 1, or 3 for red, green and blue")
    return found


def _with_channels(path: Path, values: NDArray[np.float32], channels: int) -> NDArray[np.float32]:
    """Return values with as many channels as the scene's light has."""
    if channels == 3:
        return np.repeat(values, 3, axis=1) if values.shape[1] == 1 else values
    if values.shape[1] == 3:
        same = (values == values[:, :1]) | np.isnan(values)
        if not same.all():
            count = int((~same.all(axis=1)).sum())
            raise UsageError(f"{path}: is coloured at {count} receivers, but all casters are opaque: write one channel")
    return values[:, 0]


def _checked(path: Path, values: NDArray[np.float32], receivers: Receivers) -> NDArray[np.float32]:
    by_channel = values.reshape(receivers.count, -1)
    valid = receivers.valid
    unset = valid & ~np.isfinite(by_channel).all(axis=1)
    if unset.any():
        raise UsageError(f"{path}: {_where(unset, receivers)} NaN or infinite")
    with np.errstate(invalid="ignore"):
        outside = valid & ((by_channel < -ROUNDING) | (by_channel > 1.0 + ROUNDING)).any(axis=1)
    if outside.any():
        worst = by_channel[outside].reshape(-1)
        example = float(worst[np.abs(worst - 0.5).argmax()])
        raise UsageError(
            f"{path}: {_where(outside, receivers)} outside [0, 1], for instance {example:g}: 1 is lit, 0 is shadowed"
        )
    clipped: NDArray[np.float32] = np.where(valid[:, None], np.clip(by_channel, 0.0, 1.0), np.float32(0.0))
    return clipped.astype(np.float32).reshape(values.shape)


def _where(mask: NDArray[np.bool_], receivers: Receivers) -> str:
    pixel = int(receivers.pixel[np.flatnonzero(mask)[0]])
    at = f"{pixel % receivers.width},{pixel // receivers.width}"
    return f"{int(mask.sum())} of {int(receivers.valid.sum())} receivers (the first at pixel {at}) are"


def _line(error: Exception) -> str:
    return next(iter(str(error).splitlines()), type(error).__name__)
