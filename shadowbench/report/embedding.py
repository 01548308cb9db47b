"""Pictures inside the page: stored PNG files made small and turned into ``data:`` addresses.

Shaded pictures become lossy WebP. Failure masks (grey with a few exact colours painted on it) become lossless WebP;
when they are reduced, a pixel keeps a failure colour if *any* of the pixels it stands for has one, so that a thin
line of failures does not vanish. The bytes of one report are bounded: each picture may use its share of what is left,
and gets smaller until it fits.
"""

from __future__ import annotations

import base64
import io
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from shadowbench.errors import StoreError

PICTURE_BYTES = 8_000_000
"""What all pictures of one report may take; base64 makes 10.7 MB of it, and 500 cases have 3 MB of text."""

LADDER = ((640, 80), (480, 74), (320, 68), (200, 60))
"""(width at most [pixels], WebP quality), tried from the best; the last is taken whatever it weighs."""

_GREY_LEVELS = 24

Size = tuple[int, int]
"""Width and height [pixels]."""


@dataclass(frozen=True)
class Embedded:
    """A picture as the page shows it.

    Attributes:
        address: ``data:image/webp;base64,...``.
        width, height: Size [pixels].
    """

    address: str
    width: int
    height: int


class Embedder:
    """Turns artifact names into embedded pictures, each name once, within a budget of bytes."""

    def __init__(self, read: Callable[[str], bytes], *, picture_count: int, byte_budget: int) -> None:
        """Prepare to embed at most ``picture_count`` different pictures.

        Args:
            read: Gives an artifact's bytes by its name; may raise :class:`StoreError`.
            picture_count: Different pictures that will be asked for.
            byte_budget: What they may take together [bytes].
        """
        self._read = read
        self._pictures_left = picture_count
        self._bytes_left = byte_budget
        self._rungs = {False: 0, True: 0}
        self._done: dict[str, Embedded | None] = {}

    def picture(self, artifact: str) -> Embedded | None:
        """Return a shaded picture, or ``None`` if the artifact is gone or is no picture."""
        return self._embed(artifact, mask=False)

    def mask(self, artifact: str) -> Embedded | None:
        """Return a failure mask, or ``None`` if the artifact is gone or is no picture."""
        return self._embed(artifact, mask=True)

    def _embed(self, artifact: str, *, mask: bool) -> Embedded | None:
        if artifact not in self._done:
            image = self._open(artifact)
            self._done[artifact] = None if image is None else self._fitted(image, mask=mask)
            self._pictures_left -= 1
        return self._done[artifact]

    def _fitted(self, image: Image.Image, *, mask: bool) -> Embedded:
        share = max(self._bytes_left, 0) // max(self._pictures_left, 1)
        self._rungs[mask], encoded, size = _fitting(image, share, self._rungs[mask], mask=mask)
        self._bytes_left -= len(encoded)
        return Embedded("data:image/webp;base64," + base64.b64encode(encoded).decode("ascii"), *size)

    def _open(self, artifact: str) -> Image.Image | None:
        try:
            image = Image.open(io.BytesIO(self._read(artifact)), formats=("PNG",))
            return image.convert("RGB")
        except (OSError, StoreError, ValueError, Image.DecompressionBombError):
            return None  # the page says "no picture" in its place


def _fitting(image: Image.Image, byte_share: int, first_rung: int, *, mask: bool) -> tuple[int, bytes, Size]:
    """Return rung, WebP bytes and size of the best rung that fits, or of the last one.

    Neighbouring pictures weigh alike, so the search begins at ``first_rung``: down until a picture fits, or else up
    while the next better one can be expected to fit, growing as its area.
    """
    rung = first_rung
    size, encoded = _encoded(image, rung, mask=mask)
    while len(encoded) > byte_share and rung + 1 < len(LADDER):
        rung += 1
        size, encoded = _encoded(image, rung, mask=mask)
    while 0 < rung <= first_rung and len(encoded) * (LADDER[rung - 1][0] / LADDER[rung][0]) ** 2 <= byte_share:
        better_size, better = _encoded(image, rung - 1, mask=mask)
        if len(better) > byte_share:
            break
        rung, size, encoded = rung - 1, better_size, better
    return rung, encoded, size


def _encoded(image: Image.Image, rung: int, *, mask: bool) -> tuple[Size, bytes]:
    width, quality = LADDER[rung]
    width = min(width, image.width)
    size = (width, max(1, round(image.height * width / image.width)))
    return size, _webp(reduced_mask(image, size), None) if mask else _webp(_reduced(image, size), quality)


def _reduced(image: Image.Image, size: Size) -> Image.Image:
    return image if image.size == size else image.resize(size, Image.Resampling.LANCZOS)


def reduced_mask(image: Image.Image, size: Size) -> Image.Image:
    """Return a mask picture at ``size``: few greys, and every painted colour kept in each pixel it touches."""
    pixels = np.asarray(image)
    grey = np.asarray(_reduced(image.convert("L"), size), dtype=np.uint16)
    step = 256 // _GREY_LEVELS
    out: NDArray[np.uint8] = np.repeat((grey // step * step + step // 2).clip(0, 255).astype(np.uint8)[..., None], 3, 2)
    painted = (pixels[..., 0] != pixels[..., 1]) | (pixels[..., 1] != pixels[..., 2])
    rows, columns = np.nonzero(painted)
    out[rows * size[1] // image.height, columns * size[0] // image.width] = pixels[rows, columns]
    return Image.fromarray(out)


def _webp(image: Image.Image, quality: int | None) -> bytes:
    """Return WebP bytes, lossless where ``quality`` is ``None``."""
    file = io.BytesIO()
    if quality is None:
        image.save(file, format="WEBP", lossless=True, quality=20, method=2, exact=True)
    else:
        image.save(file, format="WEBP", quality=quality, method=2)
    return file.getvalue()
