"""A scored visibility kept among the pictures, so that its case can be looked into again.

The floats of all receivers in order, little-endian, four bytes a pixel of an RGBA picture: as a PNG file it goes
wherever the pictures of a case go, into archives and to a results service, and comes back to the bit.
"""

from __future__ import annotations

import io
import math

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from shadowbench.errors import UsageError

ARTIFACT = "visibility"
"""Its name among a row's artifacts."""


def written(visibility: NDArray[np.float32]) -> bytes:
    """Return a visibility, shape [n] or [n, 3], as a PNG file's bytes."""
    values = np.ascontiguousarray(visibility, dtype="<f4").reshape(-1)
    width = max(1, math.isqrt(len(values)))
    height = max(1, -(-len(values) // width))
    padded = np.zeros(width * height, "<f4")
    padded[: len(values)] = values
    file = io.BytesIO()
    Image.fromarray(padded.view(np.uint8).reshape(height, width, 4)).save(file, format="PNG")
    return file.getvalue()


def read(content: bytes, shape: tuple[int, ...]) -> NDArray[np.float32]:
    """Return the visibility that :func:`written` wrote.

    Args:
        content: The file.
        shape: Of what was written: receivers, or receivers and channels.

    Raises:
        UsageError: It holds another number of values.
    """
    with Image.open(io.BytesIO(content), formats=["PNG"]) as image:
        values = np.asarray(image.convert("RGBA")).reshape(-1).view("<f4")
    count = math.prod(shape)
    width = max(1, math.isqrt(count))
    if len(values) != width * max(1, -(-count // width)):
        raise UsageError(f"the kept visibility is of another number of receivers than the {shape[0]} of today's view")
    return values[:count].astype(np.float32).reshape(shape)
