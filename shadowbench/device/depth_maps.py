"""Drawing a light's depth maps: one square map a frame, shared by every technique that starts from one."""

from __future__ import annotations

from typing import Any

import warp as wp

from shadowbench.device.depth_rasterizer import DepthRasterizer
from shadowbench.device.launch import Context
from shadowbench.light_space import Frame
from shadowbench.world import Casters


class DepthMaps:
    """The depth maps of one light, redrawn in place.

    Args:
        face_count: 1, or 6 around a point light.
        resolution: Width and height of each map [texels].
        context: Where to run.

    Attributes:
        depth: Linear depth of the nearest caster at each texel's centre, 1 where there is none; float32, shape
            [face, row, column].
    """

    def __init__(self, face_count: int, resolution: int, context: Context) -> None:
        self.depth: wp.array[Any] = wp.empty(
            (face_count, resolution, resolution), dtype=wp.float32, device=context.device
        )
        self._rasterizers = [
            DepthRasterizer(resolution, resolution, context, depth=self.depth[face]) for face in range(face_count)
        ]
        self._context = context

    def draw(self, casters: Casters, frames: tuple[Frame, ...], *, slope_bias: float = 0.0) -> None:
        """Draw all casters into every map.

        Args:
            casters: What casts.
            frames: One a map.
            slope_bias: Polygon offset's factor: stored depths grow by this many texels' worth of the triangle's
                larger depth slope.
        """
        for rasterizer in self._rasterizers:
            rasterizer.clear()
        for batch in casters.batches(self._context):
            for rasterizer, frame in zip(self._rasterizers, frames, strict=True):
                rasterizer.draw(
                    batch.vertices, batch.triangles, frame.projection, near=frame.near, slope_bias=slope_bias
                )
        for rasterizer in self._rasterizers:
            rasterizer.finish()
