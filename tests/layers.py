"""Horizontal layers under a light from straight above, and what a filter makes of them, in NumPy's float64.

Receivers lie on the ground, so that all have one depth d, and a depth map has one depth a layer: the mean of any
function of depth over a filter's window is then exact arithmetic, apart from the program's.
"""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from builders import flat_receivers, square
from numpy.typing import NDArray
from surfaces import world_of

from shadowbench.device.filter_weights import tap_weights
from shadowbench.light_space import light_frames
from shadowbench.receivers import Receivers
from shadowbench.scene import DirectionalLight
from shadowbench.world import World

Floats = NDArray[np.float64]

RECEIVERS = flat_receivers(64, 16, extent=0.8)


def layered(*layers: tuple[float, ...]) -> World:
    """A ground and, for each (height, x), a layer over all to the right of x; to the left of a third number too."""
    meshes = [square(2.0)]
    for height, *span in layers:
        vertices, triangles = square(2.0, height)
        vertices[:, 0] = np.clip(vertices[:, 0], span[0], span[1] if len(span) > 1 else None)
        meshes.append((vertices, triangles))
    return world_of(*meshes, lights={"sun": DirectionalLight((0.0, 1.0, 0.0))})


def depth_of(world: World, height: float) -> float:
    """Linear depth of a height."""
    (frame,) = light_frames(world.lights["sun"], world)
    return float(frame.project(np.array([[0.0, height, 0.0]]))[0, 2])


def window_means(
    world: World, texels: NDArray[Any], kernel: int, receivers: Receivers = RECEIVERS
) -> NDArray[np.float64]:
    """Bilinear look-up of each receiver in values of texels convolved with a Gauss window, shape [n]."""
    (frame,) = light_frames(world.lights["sun"], world)
    image = convolved(texels, kernel)
    return bilinear(image, frame.project(receivers.position)[:, :2] * len(image))


def convolved(texels: NDArray[Any], kernel: int) -> Floats:
    """Convolve an image with a Gauss window, repeating its edges."""
    image = np.ascontiguousarray(texels, dtype=np.float64)
    if kernel <= 1:
        return image
    weights = tap_weights("gauss", kernel)
    return cv2.sepFilter2D(image, -1, weights, weights, borderType=cv2.BORDER_REPLICATE)


def bilinear(image: Floats, places: Floats) -> Floats:
    """Interpolate an image at places [n, 2] in texels (column, row), repeating its edges."""
    values, weights = corner_texels(image, places)
    return (values * weights).sum(axis=1)


def corner_texels(image: Floats, places: Floats) -> tuple[Floats, Floats]:
    """Return the four texels around each place and their bilinear weights, shape [n, 4]."""
    size = len(image)
    first = np.floor(places - 0.5).astype(int)
    share = places - 0.5 - first
    values, weights = np.empty((len(places), 4)), np.empty((len(places), 4))
    for corner, (j, i) in enumerate(((0, 0), (0, 1), (1, 0), (1, 1))):
        weights[:, corner] = (share[:, 0] if i else 1.0 - share[:, 0]) * (share[:, 1] if j else 1.0 - share[:, 1])
        column, row = (np.clip(first[:, axis] + step, 0, size - 1) for axis, step in ((0, i), (1, j)))
        values[:, corner] = image[row, column]
    return values, weights
