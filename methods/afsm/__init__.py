"""Alias-free shadow maps (Aila & Laine 2004): shadow rays' result by rasterising blockers at the receivers themselves.

Receivers are transformed to the light's window and used as sampling points there, so there is no resolution and no
alias. A 2-D BSP over them, split at medians along x and y in turn until a leaf holds fewer than ``leaf_size``, finds
those that a triangle covers; each node keeps the largest depth of its unshadowed receivers, so that triangles stop at
nodes wholly in shadow or nearer to the light than themselves (section 5). ``traversal=brute-force`` tests every
receiver against every triangle instead, for small scenes.

What float32 cannot decide goes to the predicate of the ground truth, so the result is the ground truth's, bit for bit,
under directional, spot (one window) and point lights (six).

Translucent casters multiply each receiver's light by their transmittance, channel by channel and in file order; a ray
through an edge or vertex that triangles share counts once. Only opaque casters cull.

The paper's count of *sampling points tested* does not depend on the tree: it stays near half a million while the number
of triangles grows a thousandfold. So it is taken here, outside the clock, of a pass without culling; *tested after
culling* is what the frame itself did.

Limits: hard shadows. Cost: n log n for the tree; for each triangle, the nodes it touches.
"""

from __future__ import annotations

from typing import ClassVar, Literal

from shadowbench.device.irregular_bsp import BruteForce, BspCounts, IrregularBsp
from shadowbench.irregular_method import TESTED, IrregularMethod, IrregularRasterizer
from shadowbench.method import Trace
from shadowbench.parameters import ParameterModel, parameter


class AliasFreeParameters(ParameterModel):
    leaf_size: int = parameter(64, unit="receivers", help="A leaf of the BSP holds fewer than this.", ge=2, le=65536)
    culling: bool = parameter(True, unit="1", help="Stop triangles at nodes in which they can shadow nothing any more.")
    traversal: Literal["hierarchical", "brute-force"] = parameter(
        "hierarchical", unit="1", help="Through the BSP, or every receiver against every triangle."
    )


class AliasFreeShadowMaps(IrregularMethod[BspCounts]):
    """Rasterisation at the receivers, through a 2-D BSP."""

    name = "afsm"
    title = "Alias-free shadow maps"
    source = "Aila & Laine 2004"
    structure_stage = "BSP construction"
    structure_title = "BSP"
    Parameters = AliasFreeParameters
    counters: ClassVar[dict[str, str]] = {
        "2D BSP nodes": "leaves of the tree",
        "nodes visited": "nodes whose bounds are compared with a triangle, over all triangles",
        "nodes occlusion culled": "different nodes at which at least one triangle stopped because none of their "
        "unshadowed receivers lay behind it (the paper gives no definition)",
        "sampling points tested": TESTED + " (counted outside the clock, without culling)",
        "tested after culling": "those of them in leaves that culling let the frame visit",
        "decided in float64": "those of them that float32 could not decide",
    }

    parameters: AliasFreeParameters

    def make_rasterizer(self) -> IrregularRasterizer[BspCounts]:
        if self.parameters.traversal == "brute-force":
            return BruteForce(self.context)
        return IrregularBsp(self.context, leaf_size=self.parameters.leaf_size, culling=self.parameters.culling)

    def report(self, rasterizer: IrregularRasterizer[BspCounts], counts: BspCounts, trace: Trace) -> None:
        trace.count("2D BSP nodes", counts.leaves)
        trace.count("nodes visited", counts.visited)
        trace.count("nodes occlusion culled", counts.culled)
        trace.count("tested after culling", counts.tested)
        trace.count("decided in float64", counts.refined)

    def explaining_rasterizer(self) -> IrregularRasterizer[BspCounts]:
        return IrregularBsp(self.context, leaf_size=self.parameters.leaf_size, culling=False)

    def explain_window(self, rasterizer: IrregularRasterizer[BspCounts], counts: BspCounts, trace: Trace) -> None:
        trace.count("sampling points tested", counts.tested)
