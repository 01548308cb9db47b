"""Several surfaces deep: the nearest fragments of every texel, for surfaces that one sees through.

One draw replaces as many passes of depth peeling as there are layers: every texel has a short list, sorted by depth,
into which fragments are inserted. Coverage, depth and the rule for equal depths are those of
:mod:`shadowbench.device.depth_rasterizer`, so that the first layer holds the very triangles that it keeps; bands of
rows are filled side by side, and the result does not depend on the number of threads.
"""

from __future__ import annotations

from typing import Any

import warp as wp
from numpy.typing import NDArray

from shadowbench.device.depth_layers_kernels import fill_layers
from shadowbench.device.depth_rasterizer import TriangleBins
from shadowbench.device.launch import Context, launch


class LayeredRasterizer:
    """A buffer of the nearest fragments of every texel.

    Args:
        width, height: Size of the buffer [texels], at least 1 each.
        layers: How many fragments a texel keeps, at least 1.
        context: Where to run.

    Attributes:
        ids: Numbers of the nearest fragments' triangles, nearest first, -1 where there are no more; of equally near
            ones the first drawn leads; int32, shape [height * width, layers].
        depths: Their depths, 1 where there are no more, float32, same shape.

    Raises:
        ValueError: The size or the number of layers is not positive, or the size larger than 2³¹ texels.
    """

    def __init__(self, width: int, height: int, layers: int, context: Context) -> None:
        if layers < 1:
            raise ValueError(f"a texel keeps at least 1 layer, not {layers}")
        self._bins = TriangleBins(width, height, context, bytes_per_texel=8 * layers)
        shape = (width * height, layers)
        self.depths: wp.array[Any] = wp.empty(shape, dtype=wp.float32, device=context.device)
        self.ids: wp.array[Any] = wp.empty(shape, dtype=wp.int32, device=context.device)
        self.clear()

    def clear(self) -> None:
        """Empty all lists."""
        self.depths.fill_(1.0)
        self.ids.fill_(-1)

    def draw(
        self,
        vertices: wp.array[Any],
        triangles: wp.array[Any],
        projection: NDArray[Any],
        *,
        near: float | None,
        first_triangle: int = 0,
    ) -> None:
        """Draw triangles over what the buffer holds.

        Arguments as for :meth:`shadowbench.device.depth_rasterizer.DepthRasterizer.draw`.
        """
        for chunk in self._bins.of(vertices, triangles, projection, near):
            launch(
                fill_layers,
                self._bins.band_count,
                inputs=[*chunk, first_triangle],
                outputs=[self.depths, self.ids],
                context=self._bins.context,
                cuts=self._bins.cuts,
            )
