"""PNG files from others: looked at before they are decoded, decoded within limits, and sent only as encoded here."""

from __future__ import annotations

import io
import struct

from PIL import Image

from shadowbench.errors import ShadowbenchError

SIGNATURE = b"\x89PNG\r\n\x1a\n"
_MODES = frozenset({"1", "L", "LA", "P", "RGB", "RGBA", "I;16", "I"})


class PictureError(ShadowbenchError):
    """A file that is no picture, or a larger one than is taken."""


def check_png(content: bytes, most_pixels: int) -> None:
    """Decode a picture, to see whether it is one.

    Raises:
        PictureError: It is not.
    """
    _decoded(content, most_pixels)


def encoded_again(content: bytes, most_pixels: int) -> bytes:
    """Return a PNG file with the same pixels and nothing else in it.

    Raises:
        PictureError: It is no picture.
    """
    image = _decoded(content, most_pixels)
    image.info.clear()  # texts, profiles and times are not pixels
    file = io.BytesIO()
    image.save(file, format="PNG", compress_level=6)
    return file.getvalue()


def _decoded(content: bytes, most_pixels: int) -> Image.Image:
    # the size stands in the first chunk: nothing is decoded, or made room for, before it is known
    if content[:8] != SIGNATURE or content[12:16] != b"IHDR" or len(content) < 33:
        raise PictureError("is not a PNG file")
    width, height = struct.unpack(">II", content[16:24])
    if width * height > most_pixels or width == 0 or height == 0:
        raise PictureError(f"has {width} x {height} pixels; up to {most_pixels} are taken")
    try:
        image = Image.open(io.BytesIO(content), formats=("PNG",))
        frame_count = getattr(image, "n_frames", 1)
        image.load()
    except Exception as error:  # noqa: BLE001 - what a damaged file makes a decoder raise is anything
        raise PictureError(f"is not an undamaged PNG file: {type(error).__name__}") from None
    if frame_count != 1 or image.mode not in _MODES:
        raise PictureError(f"is animated, or has pixels of the kind {image.mode}")
    return image
