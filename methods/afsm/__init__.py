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

Limits: hard shadows. Cost: n log n for the tree; for each triangle, the nodes it touches.
"""

from __future__ import annotations

from typing import Any, ClassVar, Literal

import warp as wp

from shadowbench.device.blocker_bins import transmittances_of
from shadowbench.device.irregular_bsp import BruteForce, IrregularBsp
from shadowbench.device.light_samples import LightSamples
from shadowbench.method import Changes, Method, Trace, View
from shadowbench.parameters import ParameterModel, parameter
from shadowbench.receivers import Receivers
from shadowbench.scene import Light, RectangularLight
from shadowbench.world import Casters, World


class AliasFreeParameters(ParameterModel):
    leaf_size: int = parameter(64, unit="receivers", help="A leaf of the BSP holds fewer than this.", ge=2, le=65536)
    culling: bool = parameter(True, unit="1", help="Stop triangles at nodes in which they can shadow nothing any more.")
    traversal: Literal["hierarchical", "brute-force"] = parameter(
        "hierarchical", unit="1", help="Through the BSP, or every receiver against every triangle."
    )


class AliasFreeShadowMaps(Method):
    """Rasterisation at the receivers, through a 2-D BSP."""

    name = "afsm"
    title = "Alias-free shadow maps"
    source = "Aila & Laine 2004"
    self_hit = "plane"
    Parameters = AliasFreeParameters
    counters: ClassVar[dict[str, str]] = {
        "2D BSP nodes": "leaves of the tree",
        "nodes visited": "nodes whose bounds are compared with a triangle, over all triangles",
        "nodes occlusion culled": "different nodes at which at least one triangle stopped because none of their "
        "unshadowed receivers lay behind it (the paper gives no definition)",
        "sampling points tested": "unshadowed receivers in visited leaves that a triangle covers or may cover, not "
        "counting those in its plane and those nearer to the light than all of it; over all triangles in file order",
        "decided in float64": "those that float32 could not decide",
    }

    parameters: AliasFreeParameters

    def supports(self, world: World, light: Light) -> str | None:
        if isinstance(light, RectangularLight):
            return "an area light has no hard shadow"
        return None

    def build(self, casters: Casters, light: Light, view: View, changes: Changes, trace: Trace) -> None:
        self._casters, self._light = casters, light
        self._transmittances = transmittances_of(casters, self.context.device)
        if changes.light:
            self._samples = LightSamples(self.context)
            self._rasterizer: IrregularBsp | BruteForce = BruteForce(self.context)
            if self.parameters.traversal == "hierarchical":
                self._rasterizer = IrregularBsp(
                    self.context, leaf_size=self.parameters.leaf_size, culling=self.parameters.culling
                )

    def shade(self, receivers: Receivers, visibility: wp.array[Any], trace: Trace) -> None:
        triangles = self._casters.on(self.context.device)
        with trace.stage("transformation"):
            windows = self._samples.place_receivers(receivers, self._light, self._casters.world, visibility)
        for window in windows:
            with trace.stage("transformation"):
                self._rasterizer.transform(window, self._transmittances)
            with trace.stage("BSP construction"):
                self._rasterizer.build()
            with trace.stage("rasterization"):
                counts = self._rasterizer.rasterize(triangles)
                self._rasterizer.write(visibility)
            trace.count("2D BSP nodes", self._rasterizer.leaf_count)
            trace.count("nodes visited", counts.visited)
            trace.count("nodes occlusion culled", counts.culled)
            trace.count("sampling points tested", counts.tested)
            trace.count("decided in float64", counts.refined)
        trace.keep_bytes("windows of the receivers", self._samples.kept_bytes)
        trace.keep_bytes("BSP and lists of triangles", self._rasterizer.kept_bytes)
