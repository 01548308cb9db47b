"""The irregular z-buffer (Johnson et al. 2004): exact hard shadows by rasterising casters at the receivers' own places.

Receivers are transformed to light space and sorted into cells; every caster triangle is then tested against the
receivers of the cells it meets. What float32 cannot decide goes to the predicate of the ground truth, so the result is
the ground truth's, bit for bit, under directional, spot and point lights.

``layout`` says how receivers are kept: ``uniform``, a grid of cells with a list each, as published, or ``adaptive``,
strips of equal receiver count cut into cells, which follows the receivers' density.

Translucent casters multiply each receiver's light by their transmittance, channel by channel and in file order; a ray
through an edge or vertex that triangles share counts once.

Limits: hard shadows. Cost: sorting, proportional to the receivers; rasterising, to the triangles and
to the receivers that each of them covers.
"""

from __future__ import annotations

from typing import Any, ClassVar, Literal

import warp as wp

from shadowbench.device.blocker_bins import transmittances_of
from shadowbench.device.irregular_strips import IrregularStrips
from shadowbench.device.light_samples import LightSamples
from shadowbench.method import Changes, Method, Trace, View
from shadowbench.parameters import ParameterModel, parameter
from shadowbench.receivers import Receivers
from shadowbench.scene import Light, RectangularLight
from shadowbench.world import Casters, World


class IrregularZBufferParameters(ParameterModel):
    layout: Literal["adaptive", "uniform"] = parameter(
        "adaptive", unit="1", help="Strips of equal receiver count cut into cells, or the published uniform grid."
    )
    resolution: int = parameter(
        1024, unit="cells", help="Width and height of the uniform grid; the adaptive layout ignores it.", ge=1, le=8192
    )


class IrregularZBuffer(Method):
    """Rasterisation at the receivers, over cells with lists."""

    name = "irregular-z-buffer"
    title = "Irregular z-buffer"
    source = "Johnson, Mark & Burns 2004; strip layout: this project"
    self_hit = "plane"
    Parameters = IrregularZBufferParameters
    counters: ClassVar[dict[str, str]] = {
        "runs scanned": "pairs of a triangle and a strip (row of cells) in which it met receivers",
        "sampling points tested": "unshadowed receivers that a triangle covers or may cover, not counting those in "
        "its plane and those nearer to the light than all of it; over all triangles in file order",
        "decided in float64": "those that float32 could not decide",
    }

    parameters: IrregularZBufferParameters

    def supports(self, world: World, light: Light) -> str | None:
        if isinstance(light, RectangularLight):
            return "an area light has no hard shadow"
        return None

    def build(self, casters: Casters, light: Light, view: View, changes: Changes, trace: Trace) -> None:
        self._casters, self._light = casters, light
        self._transmittances = transmittances_of(casters, self.context.device)
        if changes.light:
            self._samples = LightSamples(self.context)
            self._strips = IrregularStrips(
                self.context, layout=self.parameters.layout, resolution=self.parameters.resolution
            )

    def shade(self, receivers: Receivers, visibility: wp.array[Any], trace: Trace) -> None:
        triangles = self._casters.on(self.context.device)
        with trace.stage("transformation"):
            windows = self._samples.place_receivers(receivers, self._light, self._casters.world, visibility)
        for window in windows:
            with trace.stage("transformation"):
                self._strips.transform(window, self._transmittances)
            with trace.stage("sorting"):
                self._strips.sort()
            with trace.stage("rasterization"):
                counts = self._strips.rasterize(triangles)
                self._strips.write(visibility)
            trace.count("runs scanned", counts.runs)
            trace.count("sampling points tested", counts.tested)
            trace.count("decided in float64", counts.refined)
        trace.keep_bytes("windows of the receivers", self._samples.kept_bytes)
        trace.keep_bytes("cells and lists of triangles", self._strips.kept_bytes)
