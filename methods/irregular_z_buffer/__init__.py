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

from typing import ClassVar, Literal

from shadowbench.device.irregular_strips import IrregularStrips, StripCounts
from shadowbench.irregular_method import TESTED, IrregularMethod, IrregularRasterizer
from shadowbench.method import Trace
from shadowbench.parameters import ParameterModel, parameter


class IrregularZBufferParameters(ParameterModel):
    layout: Literal["adaptive", "uniform"] = parameter(
        "adaptive", unit="1", help="Strips of equal receiver count cut into cells, or the published uniform grid."
    )
    resolution: int = parameter(
        1024, unit="cells", help="Width and height of the uniform grid; the adaptive layout ignores it.", ge=1, le=8192
    )


class IrregularZBuffer(IrregularMethod[StripCounts]):
    """Rasterisation at the receivers, over cells with lists."""

    name = "irregular-z-buffer"
    title = "Irregular z-buffer"
    source = "Johnson, Mark & Burns 2004; strip layout: this project"
    structure_stage = "sorting"
    structure_title = "cells"
    Parameters = IrregularZBufferParameters
    counters: ClassVar[dict[str, str]] = {
        "runs scanned": "pairs of a triangle and a strip (row of cells) in which it met receivers",
        "tested after culling": TESTED + "; those in runs that the frame scanned",
        "decided in float64": "those of them that float32 could not decide",
    }

    parameters: IrregularZBufferParameters

    def make_rasterizer(self) -> IrregularRasterizer[StripCounts]:
        return IrregularStrips(self.context, layout=self.parameters.layout, resolution=self.parameters.resolution)

    def report(self, rasterizer: IrregularRasterizer[StripCounts], counts: StripCounts, trace: Trace) -> None:
        trace.count("runs scanned", counts.runs)
        trace.count("tested after culling", counts.tested)
        trace.count("decided in float64", counts.refined)
