"""Hard visibility of many points at once, by rasterising casters at their places in light space.

For whoever needs tens of millions of exact tests: references that filter or supersample. The answers are those of the
exact predicate for every point, as :func:`shadowbench.reference.hard_reference` gives them to receivers, except that
points have no plane of their own to be turned away by: the caller knows which those are. Translucent casters dim, each
crossing by its caster's transmittance.
"""

from typing import Any

import warp as wp

from shadowbench.device.blocker_bins import transmittances_of
from shadowbench.device.irregular_strips import IrregularStrips
from shadowbench.device.launch import Context
from shadowbench.device.light_samples import LightSamples
from shadowbench.scene import Light
from shadowbench.world import Casters


class PointVisibility:
    """Asks for the visibility of points; memory is kept between calls.

    Args:
        casters: Opaque or translucent.
        light: Directional, spot or point.
        context: Where to run.
    """

    def __init__(self, casters: Casters, light: Light, context: Context) -> None:
        self._casters, self._light, self._context = casters, light, context
        self._samples = LightSamples(context)
        self._transmittances = transmittances_of(casters, context.device)
        self._strips = IrregularStrips(context, layout="adaptive", resolution=1)

    def ask(self, position: wp.array[Any], visibility: wp.array[Any]) -> None:
        """Decide points.

        Args:
            position: World positions, wp.vec3, shape [n].
            visibility: Set to 1 where lit, to 0 where an opaque caster is in between or the light does not reach, to
                the product of the transmittances where translucent ones are; float32, shape [n], or [n, 3] by channel.

        Raises:
            SceneError: An area light.
        """
        windows = self._samples.place_points(position, self._light, self._casters.scale, visibility)
        for window in windows:
            self._strips.transform(window, self._transmittances)
            self._strips.build()
            self._strips.rasterize(self._casters.batches(self._context))
            self._strips.write(visibility)
