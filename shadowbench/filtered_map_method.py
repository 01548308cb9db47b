"""What all techniques have in common that filter a light's map before it is looked up.

``build()`` draws depth maps, encodes each depth as something that may be averaged, convolves that with a Gauss window,
and makes the mip chain; ``shade()`` looks up a mean and turns it into a visibility. A subclass says what a depth is
encoded as and how a mean is read.

What is kept is the encoded map with its chain, as a renderer would keep it; the depth maps and the map before the
convolution are scratch, which a renderer would lend from elsewhere: they stay allocated here, so that memory in use is
larger, but are not counted.

Point lights have six maps. A window and a chain end at their face's edges, where the edge's texel is repeated, and a
receiver's look-up stays in its face: across the cube's edges shadows have seams as wide as the filter.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, ClassVar, Literal

import numpy as np
import warp as wp
from numpy.typing import NDArray
from pydantic import field_validator

from shadowbench.depth_map_method import MAP_COUNTERS, DepthMapMethod, DepthMapParameters
from shadowbench.device.filter_weights import gauss_sigma, tap_weights
from shadowbench.device.filtered_lookup import Sampling, pixel_points, sampling_by
from shadowbench.device.launch import launch
from shadowbench.device.mip_chains import MOST_VALUES, MipChain, chain_texels
from shadowbench.device.separable_filters import convolve
from shadowbench.light_space import CUBE_AXES
from shadowbench.method import Changes, LightSpaceKernel, Trace, View
from shadowbench.parameters import parameter
from shadowbench.receivers import Receivers
from shadowbench.scene import Light, PointLight
from shadowbench.world import Casters, World

if TYPE_CHECKING:
    from shadowbench.account import Account, Step
    from shadowbench.map_account import LookedUp

FILTERED_COUNTERS = {
    **MAP_COUNTERS,
    "chain texels": "texels of the filtered map with its mip levels",
    "texels looked up": "texels averaged or tested, over all valid receivers",
}


class FilteredMapParameters(DepthMapParameters):
    """The parameters that every filtered map has."""

    kernel: int = parameter(
        5, unit="texels", help="Width of the Gauss window the map is convolved with; 0 for none, else odd.", ge=0, le=63
    )
    filtering: Literal["nearest", "bilinear", "trilinear", "anisotropic"] = parameter(
        "trilinear", unit="1", help="How the map is looked up; the last two through its mip chain."
    )
    anisotropy: int = parameter(10, unit="1", help="Most taps of an anisotropic look-up; others take one.", ge=1, le=16)
    slope_bias: float = parameter(
        0.0, unit="texels", help="Polygon offset: depths drawn grow by this many texels of slope.", ge=0.0, le=64.0
    )

    @field_validator("kernel")
    @classmethod
    def _windows_have_a_centre(cls, width: int) -> int:
        if width > 0 and width % 2 == 0:
            raise ValueError("a window has a centre: its width is odd, or 0 for none")
        return width


class FilteredMapMethod(DepthMapMethod):
    """A technique whose ``build()`` makes a filtered map."""

    counters: ClassVar[dict[str, str]] = FILTERED_COUNTERS
    map_name: str
    """What the map is called in stages and among what is kept."""

    parameters: FilteredMapParameters
    chain: MipChain
    """The filtered map; there after ``build()``, as are the two below."""
    encoded: wp.array[Any]
    """The map before the convolution, shape [face, row, column, channel]; without one, level 0 of the chain."""
    sampling: Sampling

    def texel_format(self) -> tuple[int, Any]:
        """Return the number of values a texel of the map, and their Warp type."""
        return 1, wp.float32

    @abstractmethod
    def encode(self, depth: wp.array[Any], target: wp.array[Any]) -> None:
        """Write what each depth is encoded as: from [face, row, column] to [face, row, column, channel]."""

    def convolve(self, source: wp.array[Any], target: wp.array[Any]) -> None:
        """Convolve an encoded map with the window."""
        convolve(source, target, tap_weights("gauss", self.parameters.kernel), self.context)

    def fill_levels(self, chain: MipChain) -> None:
        """Make a chain's levels from its level 0."""
        chain.fill_with_means()

    def polygon_offset(self) -> float:
        return self.parameters.slope_bias

    @property
    def is_convolved(self) -> bool:
        """Whether there is a window of more than one texel."""
        return self.parameters.kernel > 1

    @property
    def has_levels(self) -> bool:
        """Whether look-ups need a mip chain."""
        return self.parameters.filtering in ("trilinear", "anisotropic")

    def new_chain(self, channels: int, dtype: Any) -> MipChain:
        """Return an empty chain over all faces."""
        faces, size, _ = self.depth.shape
        return MipChain(faces, size, self.context, channels=channels, dtype=dtype, has_levels=self.has_levels)

    def supports(self, world: World, light: Light) -> str | None:
        reason = super().supports(world, light)
        if reason is not None:
            return reason
        faces = len(CUBE_AXES) if isinstance(light, PointLight) else 1
        texels = chain_texels(self.parameters.resolution, has_levels=self.has_levels)
        values = faces * texels * self.texel_format()[0]
        if values > MOST_VALUES:
            return f"its map would hold {values:,} values, more than {MOST_VALUES:,}"
        return None

    def build(self, casters: Casters, light: Light, view: View, changes: Changes, trace: Trace) -> None:
        self.draw_maps(casters, light, trace)
        if getattr(self, "chain", None) is None:
            channels, dtype = self.texel_format()
            self.chain = self.new_chain(channels, dtype)
            base = self.chain.level(0)
            self.encoded = wp.empty_like(base) if self.is_convolved else base
            self.sampling = sampling_by(self.parameters.filtering, self.parameters.anisotropy)
        with trace.stage(self.map_name):
            self.encode(self.depth, self.encoded)
        if self.is_convolved:
            with trace.stage("convolution"):
                self.convolve(self.encoded, self.chain.level(0))
        if self.has_levels:
            with trace.stage("mip chain"):
                self.fill_levels(self.chain)
        trace.count("chain texels", self.chain.texel_count)
        trace.keep(self.map_name, self.chain.values)

    def look_up(
        self,
        kernel: wp.Kernel,
        receivers: Receivers,
        outputs: list[wp.array[Any]],
        trace: Trace,
        *,
        arguments: Sequence[Any],
        bias: float | None = None,
    ) -> None:
        """Launch a look-up over all receivers.

        Args:
            kernel: Takes the maps, the receivers, the bias, the chain with its layout and sampling, and ``arguments``;
                writes the first of ``outputs``, the number of texels it reads, and the rest of ``outputs``.
            receivers: The visible samples.
            outputs: Visibility first.
            trace: Where the stage and the counter go.
            arguments: The technique's own.
            bias: Taken off the receivers' depths; the parameter's if not given.
        """
        texels = wp.empty(receivers.count, dtype=wp.int32, device=self.context.device)
        points = pixel_points(receivers.on(self.context.device))
        taken_off = self.parameters.bias if bias is None else bias
        chain = self.chain
        with trace.stage("look-up"):
            launch(
                kernel,
                receivers.count,
                inputs=[self.lookup, points, taken_off, chain.values, chain.layout, self.sampling, *arguments],
                outputs=[outputs[0], texels, *outputs[1:]],
                context=self.context,
            )
        trace.count("texels looked up", int(texels.numpy().sum()))

    def channel_names(self) -> tuple[str, ...]:
        """Return what each value of a texel is called in an account."""
        return ("stored",)

    def account_of_mean(self, receiver: Receivers, averaged: LookedUp) -> tuple[Step, float] | None:
        """Return the step from a receiver's mean to its visibility, for :meth:`account`; ``None`` has none.

        Args:
            receiver: One receiver, not known without a look-up.
            averaged: The texels that its look-up averages.
        """
        return None

    def tell(
        self,
        kernel: wp.Kernel,
        receiver: Receivers,
        value_count: int,
        *,
        arguments: Sequence[Any],
        bias: float | None = None,
    ) -> NDArray[np.float32]:
        """Launch a kernel that takes what :meth:`look_up`'s does on one receiver; return the values that it writes."""
        values = wp.zeros(value_count, dtype=wp.float32, device=self.context.device)
        points = pixel_points(receiver.on(self.context.device))
        taken_off = self.parameters.bias if bias is None else bias
        chain = self.chain
        inputs = [self.lookup, points, taken_off, chain.values, chain.layout, self.sampling, *arguments]
        launch(kernel, 1, inputs=inputs, outputs=[values], context=self.context)
        found: NDArray[np.float32] = values.numpy()
        return found

    def account(self, receivers: Receivers, index: int) -> Account | None:
        from shadowbench.account import Account
        from shadowbench.map_account import known_account, looked_up

        p, receiver = self.parameters, receivers.only(index)
        place, steps = self.account_before_test(receiver, p.kernel)
        if place.state >= 0:
            return known_account(place)
        averaged = looked_up(
            self.lookup, receiver, self.chain, self.sampling, p.slope_bias, self.channel_names(), self.context
        )
        told = self.account_of_mean(receiver, averaged)
        if told is None:
            return None
        return Account((*steps, averaged.step, told[0]), told[1])

    def kernel(self, receivers: Receivers) -> LightSpaceKernel | None:
        """Return the window on level 0, which a magnified map is filtered with.

        Without one, the tent of the interpolation, or nothing where the nearest texel is taken. Where a pixel covers
        several texels its own footprint is wider, as it should: that is antialiasing, not the technique's filter.
        """
        p = self.parameters
        if self.is_convolved:
            return LightSpaceKernel("gauss", float(p.kernel), p.resolution, gauss_sigma(p.kernel))
        return None if p.filtering == "nearest" else LightSpaceKernel("bilinear", 2.0, p.resolution)
