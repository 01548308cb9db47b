"""Exponential shadow maps (Annen, Mertens, Seidel, Flerackers & Kautz 2008): store e^(c z), so that means are tests.

Where a receiver lies no nearer than anything in its footprint, the step function of d - z is close to e^(-c (d - z)),
the product of e^(-c d) and e^(c z): the map of e^(c z) can be convolved, mip-mapped and interpolated, and one look-up
gives the filtered test. Residual light at a separation of Δ is e^(-c Δ).

Where something in the footprint lies farther than the receiver the mean exceeds 1, and a shadow would be lost. Such
failures are found by ``classification``: ``threshold`` calls a mean over 1 + ``epsilon`` a failure; ``z-max`` a
receiver nearer than the farthest texel of its footprint by more than ``offset``, from a second map of largest depths
(it never misses what a threshold finds, if ``offset`` is 0). A failing receiver falls back to the bilinear mean of
the four nearest texels' tests, each clamped to 1, on level 0 of the map that is kept (``stored``, as published: under
a convolution these texels are blurred) or of the map before the convolution (``unblurred``: exact, and kept besides).
``epsilon`` is at least 1e-4: below that, the rounding of exponentials decides.

``log_space`` stores z itself and convolves, mip-maps and interpolates e^(c z) with the largest z factored out (after
Salvi 2008): the same means without their range, so that c may exceed the 87 at which float32 ends, at the price of
exponentials in every filter. Polygon offset (``slope_bias``) is not needed by the means, which on a plane are those of
the plane itself; it lightens what falls back. Both classifications allow for the offset that the receiver's own plane
was drawn with.

Limits: light leaks where a blocker is close before its receiver; failures at depth discontinuities turn into the
aliasing of a 2 x 2 filter. Cost: one float a texel, 4/3 of that with mip levels, and one look-up a receiver; Z-Max as
much again.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, ClassVar, Literal

import numpy as np
import warp as wp
from pydantic import model_validator

from shadowbench.account import Quantity, Step, number
from shadowbench.device.depth_encodings import encode_exponentials
from shadowbench.device.filter_weights import tap_weights
from shadowbench.device.launch import Context
from shadowbench.device.mip_chains import MipChain
from shadowbench.device.separable_filters import convolve, convolve_logarithms, keep_maxima
from shadowbench.filtered_map_method import FILTERED_COUNTERS, FilteredMapMethod, FilteredMapParameters
from shadowbench.method import Changes, Trace, View
from shadowbench.methods.esm import kernels
from shadowbench.parameters import parameter
from shadowbench.receivers import Receivers
from shadowbench.scene import Light
from shadowbench.world import Casters

if TYPE_CHECKING:
    from shadowbench.map_account import LookedUp

_MOST_IN_FLOAT32 = 87.0
"""Beyond this e^(-c d) turns subnormal, and soon e^(c z) infinite."""

_KERNELS = {
    (False, "none"): kernels.look_up_linear,
    (False, "threshold"): kernels.look_up_linear_by_threshold,
    (False, "z-max"): kernels.look_up_linear_by_z_max,
    (True, "none"): kernels.look_up_logarithmic,
    (True, "threshold"): kernels.look_up_logarithmic_by_threshold,
    (True, "z-max"): kernels.look_up_logarithmic_by_z_max,
}


class EsmParameters(FilteredMapParameters):
    c: float = parameter(
        80.0, unit="1", help="Steepness of the exponential; at most 87 unless log_space is set.", gt=0.0, le=10000.0
    )
    classification: Literal["none", "threshold", "z-max"] = parameter(
        "threshold", unit="1", help="How failures are found; none clamps them to lit."
    )
    epsilon: float = parameter(
        0.05, unit="1", help="For threshold: a mean over 1 plus this is a failure.", ge=1.0e-4, le=1.0e6
    )
    offset: float = parameter(
        0.005, unit="depth", help="For z-max: how much nearer than its footprint's farthest may be.", ge=0.0, le=1.0
    )
    fallback_source: Literal["stored", "unblurred"] = parameter(
        "stored", unit="1", help="Texels a failing receiver is tested with: of the kept map, or before convolution."
    )
    log_space: bool = parameter(False, unit="1", help="Store z and filter e^(c z) without its range.")

    @model_validator(mode="after")
    def _exponentials_fit_into_float32(self) -> EsmParameters:
        if self.c > _MOST_IN_FLOAT32 and not self.log_space:
            raise ValueError(
                f"c = {self.c:g} overflows float32, in which e^(c z) is stored; "
                f"take at most {_MOST_IN_FLOAT32:g}, or set log_space"
            )
        return self


class ExponentialShadowMaps(FilteredMapMethod):
    """One exponential a texel, filtered beforehand."""

    name = "esm"
    title = "Exponential shadow maps"
    source = "Annen et al. 2008; filtering in log space: Salvi 2008"
    Parameters = EsmParameters
    map_name = "exponential map"
    counters: ClassVar[dict[str, str]] = {
        **FILTERED_COUNTERS,
        "receivers classified": "valid receivers that the classification calls failures",
    }

    parameters: EsmParameters
    _maxima: MipChain | None = None

    def __init__(self, parameters: EsmParameters, context: Context) -> None:
        super().__init__(parameters, context)
        if parameters.log_space:
            self.map_name = "logarithmic map"

    def encode(self, depth: wp.array[Any], target: wp.array[Any]) -> None:
        if self.parameters.log_space:
            wp.copy(target.flatten(), depth.flatten())
        else:
            encode_exponentials(depth, target, self.parameters.c, self.context)

    def convolve(self, source: wp.array[Any], target: wp.array[Any]) -> None:
        p = self.parameters
        weights = tap_weights("gauss", p.kernel)
        if p.log_space:
            convolve_logarithms(source, target, weights, p.c, self.context)
        else:
            convolve(source, target, weights, self.context)

    def fill_levels(self, chain: MipChain) -> None:
        if self.parameters.log_space:
            chain.fill_with_logarithmic_means(self.parameters.c)
        else:
            chain.fill_with_means()

    def build(self, casters: Casters, light: Light, view: View, changes: Changes, trace: Trace) -> None:
        super().build(casters, light, view, changes, trace)
        p = self.parameters
        if p.classification == "z-max":
            if self._maxima is None:
                self._maxima = self.new_chain(1, wp.float32)
            base = self._maxima.level(0)
            with trace.stage("maximum map"):
                keep_maxima(self.depth.reshape(base.shape), base, max(p.kernel, 1), self.context)
                if self.has_levels:
                    self._maxima.fill_with_maxima()
            trace.keep("maximum map", self._maxima.values)
        if self._is_unblurred_kept:
            trace.keep("unblurred map", self.encoded)

    @property
    def _is_unblurred_kept(self) -> bool:
        p = self.parameters
        return self.is_convolved and p.classification != "none" and p.fallback_source == "unblurred"

    def shade(self, receivers: Receivers, visibility: wp.array[Any], trace: Trace) -> None:
        p = self.parameters
        arguments: list[Any] = [p.c]
        outputs = [visibility]
        if p.classification != "none":
            arguments.append(p.slope_bias)
            arguments.append(self.encoded.flatten() if self._is_unblurred_kept else self.chain.values)
            arguments += [1.0 + p.epsilon] if self._maxima is None else [self._maxima.values, p.offset]
            outputs.append(wp.empty(receivers.count, dtype=wp.uint8, device=self.context.device))
        self.look_up(_KERNELS[p.log_space, p.classification], receivers, outputs, trace, arguments=arguments)
        if p.classification != "none":
            classified = outputs[1].numpy()
            trace.mask("classified", classified)
            trace.count("receivers classified", int(classified.sum()))

    def channel_names(self) -> tuple[str, ...]:
        return ("z",) if self.parameters.log_space else ("e^(c z)",)

    def account_of_mean(self, receiver: Receivers, averaged: LookedUp) -> tuple[Step, float]:
        from shadowbench.methods.esm.account_kernels import VALUE_COUNT, tell_linear, tell_logarithmic

        p = self.parameters
        fallback = self.encoded.flatten() if self._is_unblurred_kept else self.chain.values
        none = wp.empty(0, dtype=wp.float32, device=self.context.device)
        maxima = none if self._maxima is None else self._maxima.values
        kernel = tell_logarithmic if p.log_space else tell_linear
        told = self.tell(kernel, receiver, VALUE_COUNT, arguments=[p.c, p.slope_bias, fallback, maxima, p.offset])
        depth, falloff, mean, polygon_offset, tested, four, farthest, allowed = (float(value) for value in told)
        greatest = np.float32(1.0 + p.epsilon)
        quantities = [
            Quantity("c", p.c),
            Quantity("receiver depth d, less the bias", depth, "depth"),
            Quantity("polygon offset at the receiver", polygon_offset, "depth"),
        ]
        if p.log_space:
            lines = [f"mean of e^(c (z - d)) = {number(mean)}"]
            quantities.append(Quantity("mean of e^(c (z - d))", mean))
        else:
            stored = mean / falloff if falloff > 0.0 else math.inf
            quantities += [Quantity("mean of e^(c z)", stored), Quantity("e^(-c d)", falloff)]
            lines = [f"e^(-c d) · mean of e^(c z) = {number(falloff)} · {number(stored)} = {number(mean)}"]
        is_failure = False
        if p.classification == "threshold":
            is_failure = bool(told[4] > greatest)
            lines.append(
                f"{number(tested)} {'>' if is_failure else '<='} 1 + epsilon = {number(float(greatest))}: "
                + ("a failure, by its own threshold" if is_failure else "no failure")
            )
        elif p.classification == "z-max":
            is_failure = bool(told[7] < told[6])
            quantities.append(Quantity("farthest depth of the footprint", farthest, "depth"))
            lines.append(
                f"d + polygon offset + offset = {number(allowed)} {'<' if is_failure else '>='} {number(farthest)}: "
                + ("a failure, by z-max" if is_failure else "no failure")
            )
        result = float(min(told[5] if is_failure else told[2], np.float32(1.0)))
        if is_failure:
            quantities.append(Quantity("the four nearest texels' tests, each clamped to 1", four))
            lines.append(f"falls back to the four nearest texels: {number(four)}")
        lines.append(f"visibility = min(., 1) = {number(result)}")
        return Step("exponential test", tuple(quantities), tuple(lines)), result
