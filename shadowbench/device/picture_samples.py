"""Which surfaces the samples of every pixel see, nearest first: supersampling and semi-transparent surfaces.

A pixel's samples lie at the same places in every pixel; each is drawn with the window shifted under the pixel grid, so
that the rasteriser needs to know nothing of samples. A sample sees through translucent surfaces, up to a number of
layers, and ends at the first opaque one.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shadowbench.device.depth_layers import LayeredRasterizer
from shadowbench.device.depth_rasterizer import DepthRasterizer
from shadowbench.device.launch import Context
from shadowbench.light_space import Frame
from shadowbench.world import World


@dataclass(frozen=True, eq=False)
class SeenSurfaces:
    """Surfaces seen, sorted by pixel, then by sample, then nearest first; all arrays int32, shape [n].

    Attributes:
        pixel: ``row * width + column``.
        sample: Index into the pattern.
        layer: 0 for the nearest surface of the sample.
        triangle: Of the world.
    """

    pixel: NDArray[np.int32]
    sample: NDArray[np.int32]
    layer: NDArray[np.int32]
    triangle: NDArray[np.int32]


def sample_pattern(samples: int) -> NDArray[np.float64]:
    """Return where a pixel's samples lie in it, x to the right and y down, in (0, 1), shape [samples, 2].

    Hammersley's points: x in equal steps, y in the order of the index's binary digits mirrored at the point, in equal
    steps too. So each of as many equal columns, and rows, has one sample in its middle: what a vertical or horizontal
    edge covers is right to within half a sample. One sample is the centre.
    """
    index = np.arange(samples)
    digit_count = int(samples).bit_length()
    mirrored = sum((index >> digit & 1) << (digit_count - 1 - digit) for digit in range(digit_count))
    rank = np.argsort(np.argsort(mirrored))
    return (np.stack([index, rank], axis=1) + 0.5) / samples


class PictureSamples:
    """Draws the samples of a picture, one after the other; memory is kept between runs.

    Args:
        width, height: Picture size [pixels].
        samples: Of every pixel, at least 1.
        layers: Most surfaces that a sample sees, at least 1.
        context: Where to run.

    Attributes:
        pattern: :func:`sample_pattern` of ``samples``.

    Raises:
        ValueError: A size or number is not positive.
    """

    def __init__(self, width: int, height: int, samples: int, layers: int, context: Context) -> None:
        self.pattern = sample_pattern(samples)
        self._width, self._height, self._context = width, height, context
        self._surfaces: DepthRasterizer | LayeredRasterizer
        if layers == 1:
            self._surfaces = DepthRasterizer(width, height, context, keep_ids=True)
        else:
            self._surfaces = LayeredRasterizer(width, height, layers, context)
        self._seen = np.empty((width * height, samples, layers), dtype=np.int32)

    def find(self, world: World, frame: Frame) -> SeenSurfaces:
        """Draw.

        Args:
            world: What is seen; one sees through instances that let light through.
            frame: The camera's.
        """
        seen = self._seen
        for sample, place in enumerate(self.pattern):
            shifted = self._shifted(frame, place)
            self._surfaces.clear()
            for batch in world.batches(self._context):
                self._surfaces.draw(
                    batch.vertices,
                    batch.triangles,
                    shifted.projection,
                    near=shifted.near,
                    first_triangle=batch.first_triangle,
                )
            ids: Any = self._surfaces.ids
            seen[:, sample] = ids.numpy().reshape(len(seen), -1)
        is_opaque = np.array([max(i.transmittance) == 0.0 for i in world.instances])
        for layer in range(1, seen.shape[2]):
            before, behind = seen[:, :, layer - 1], seen[:, :, layer]
            behind[before < 0] = -1
            there = behind >= 0
            behind[there] = np.where(is_opaque[world.instance_of(before[there])], -1, behind[there])
        return self._flattened()

    def _shifted(self, frame: Frame, place: NDArray[np.float64]) -> Frame:
        """Return the frame in which a sample's place in the pixel is where the frame has the pixel's centre."""
        projection = frame.projection.copy()
        projection[0] += (0.5 - place[0]) / self._width * projection[3]
        projection[1] += (0.5 - place[1]) / self._height * projection[3]
        return replace(frame, projection=projection)

    def _flattened(self) -> SeenSurfaces:
        _, samples, layers = self._seen.shape
        flat = self._seen.reshape(-1)
        index = np.flatnonzero(flat >= 0)
        pixel, within = np.divmod(index, samples * layers)
        sample, layer = np.divmod(within, layers)
        pixel, sample, layer = (a.astype(np.int32) for a in (pixel, sample, layer))
        return SeenSurfaces(pixel, sample, layer, flat[index])
