"""What all techniques that start from a light's depth maps have in common.

A subclass says how much polygon offset it needs and shades from :attr:`DepthMapMethod.lookup`; which lights there are
maps for, drawing them, and what is counted and kept is the same for all.
"""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np
import warp as wp
from numpy.typing import NDArray

from shadowbench.device.depth_maps import DepthMaps
from shadowbench.device.percentage_closer import percentage_closer
from shadowbench.device.shadow_lookup import LightMaps, light_maps
from shadowbench.light_picture import depth_picture
from shadowbench.light_space import light_frames
from shadowbench.method import Changes, Method, Trace, View
from shadowbench.parameters import ParameterModel, parameter
from shadowbench.receivers import Receivers
from shadowbench.scene import Light, RectangularLight
from shadowbench.world import Casters, World

MAP_COUNTERS = {
    "triangles drawn": "casters' triangles times the number of maps",
    "map texels": "texels over all maps",
}
"""Counters of building the maps; a subclass adds those of its look-up."""


class DepthMapParameters(ParameterModel):
    """The parameters that every depth map has."""

    resolution: int = parameter(1024, unit="texels", help="Width and height of each map.", ge=1, le=16384)
    bias: float = parameter(1.0e-5, unit="depth", help="Constant bias, taken off the receiver's depth.", ge=0.0, le=1.0)


class DepthMapMethod(Method):
    """A technique whose ``build()`` draws the light's depth maps: one, or six around a point light."""

    counters: ClassVar[dict[str, str]] = MAP_COUNTERS

    parameters: DepthMapParameters
    lookup: LightMaps
    """The maps and the light, as look-up kernels take them; there after ``build()``."""
    _maps: DepthMaps | None = None

    @property
    def depth(self) -> wp.array[Any]:
        """The depth maps, float32, shape [face, row, column]; there after ``build()``."""
        assert self._maps is not None
        return self._maps.depth

    def polygon_offset(self) -> float:
        """Return the polygon offset's factor that the maps are drawn with [texels of slope]."""
        return 0.0

    def supports(self, world: World, light: Light) -> str | None:
        if isinstance(light, RectangularLight):
            return "an area light has no depth map"
        if not world.casters.is_opaque:
            return "a depth map holds opaque casters only"
        return None

    def draw_maps(self, casters: Casters, light: Light, trace: Trace) -> None:
        """Draw the maps and set :attr:`lookup`."""
        frames = light_frames(light, casters.world)
        if self._maps is None:
            self._maps = DepthMaps(len(frames), self.parameters.resolution, self.context)
        with trace.stage("depth map"):
            self._maps.draw(casters, frames, slope_bias=self.polygon_offset())
        self.lookup = light_maps(light, frames, self._maps.depth)
        trace.count("triangles drawn", casters.triangle_count * len(frames))
        trace.count("map texels", self._maps.depth.size)

    def build(self, casters: Casters, light: Light, view: View, changes: Changes, trace: Trace) -> None:
        self.draw_maps(casters, light, trace)
        trace.keep("shadow map", self.depth)

    def explain(self, receivers: Receivers, trace: Trace) -> None:
        """Draw the depth maps."""
        trace.picture("depth map", depth_picture(self.depth.numpy()))

    def exact_on_map(self, receivers: Receivers) -> NDArray[np.float32] | None:
        kernel = self.kernel(receivers)
        if kernel is None:
            return None
        return percentage_closer(self.lookup, receivers, kernel, self.parameters.bias, self.context)
