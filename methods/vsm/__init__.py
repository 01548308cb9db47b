"""Variance shadow maps (Donnelly & Lauritzen 2006): store depth and its square, bound the lit share by Chebyshev.

Mean M1 and mean square M2 over a footprint give the depths' mean and variance σ² = M2 - M1²; at most
σ² / (σ² + (d - M1)²) of them can lie at or beyond a receiver at d > M1, and that bound is taken for the visibility. A
receiver at or before the mean is lit. Behind a single plane of blockers parallel to the map the bound is exact. Both
moments may be convolved, mip-mapped and interpolated.

``minimum_variance`` keeps rounding from being taken for blockers; ``slope_term`` adds the variance ¼ (z_x² + z_y²) that
a plane has within a texel; ``bleeding_reduction`` a cuts the bound's tail off, (p - a) / (1 - a).

Limits: where blockers lie at several depths the variance between them lets light through (two blockers at a and b, a
share q at b, give σ² = q (1 - q) (b - a)² and thus light at every c > b). Cost: two floats a texel, 4/3 of that with
mip levels, and one look-up a receiver.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp

from shadowbench.account import Quantity, Step, number
from shadowbench.device.depth_encodings import encode_moments
from shadowbench.filtered_map_method import FilteredMapMethod, FilteredMapParameters
from shadowbench.method import Trace
from shadowbench.methods.vsm.kernels import look_up_moments
from shadowbench.parameters import parameter
from shadowbench.receivers import Receivers

if TYPE_CHECKING:
    from shadowbench.map_account import LookedUp


class VsmParameters(FilteredMapParameters):
    minimum_variance: float = parameter(
        1.0e-6, unit="depth²", help="Variance is taken for at least this.", ge=0.0, le=1.0
    )
    bleeding_reduction: float = parameter(
        0.0, unit="1", help="Visibility that is cut off, the rest being stretched over it.", ge=0.0, le=0.99
    )
    slope_term: bool = parameter(
        False, unit="1", help="Add the variance of a plane within a texel to the second moment."
    )


class VarianceShadowMaps(FilteredMapMethod):
    """Two moments a texel, filtered beforehand."""

    name = "vsm"
    title = "Variance shadow maps"
    source = "Donnelly & Lauritzen 2006; bleeding reduction: Lauritzen, GPU Gems 3"
    Parameters = VsmParameters
    map_name = "moment map"

    parameters: VsmParameters

    def texel_format(self) -> tuple[int, Any]:
        return 2, wp.float32

    def encode(self, depth: wp.array[Any], target: wp.array[Any]) -> None:
        encode_moments(depth, target, self.context, has_slopes=self.parameters.slope_term)

    def shade(self, receivers: Receivers, visibility: wp.array[Any], trace: Trace) -> None:
        p = self.parameters
        arguments = [p.minimum_variance, p.bleeding_reduction]
        self.look_up(look_up_moments, receivers, [visibility], trace, arguments=arguments)

    def channel_names(self) -> tuple[str, ...]:
        return "z", "z²"

    def account_of_mean(self, receiver: Receivers, averaged: LookedUp) -> tuple[Step, float]:
        from shadowbench.methods.vsm.account_kernels import tell_bound

        p = self.parameters
        arguments = [p.minimum_variance, p.bleeding_reduction]
        told = self.tell(tell_bound, receiver, 5, arguments=arguments)
        depth, mean, square, bound, reduced = (float(value) for value in told)
        variance = float(max(told[2] - told[1] * told[1], np.float32(p.minimum_variance)))
        quantities = (
            Quantity("receiver depth d, less the bias", depth, "depth"),
            Quantity("M1, mean depth", mean, "depth"),
            Quantity("M2, mean square", square, "depth²"),
            Quantity("variance, at least minimum_variance", variance, "depth²"),
            Quantity("standard deviation", math.sqrt(variance), "depth"),
            Quantity("d - M1", depth - mean, "depth"),
            Quantity("bound", bound),
        )
        if depth <= mean:
            lines = [f"d = {number(depth)} <= M1 = {number(mean)}: lit"]
        else:
            behind, least = number(depth - mean), number(p.minimum_variance)
            lines = [
                f"variance = max({number(square)} - {number(mean)}², {least}) = {number(variance)}",
                f"bound = variance / (variance + (d - M1)²) = variance / (variance + {behind}²) = {number(bound)}",
            ]
        a = p.bleeding_reduction
        lines.append(f"visibility = clamp((bound - {number(a)}) / (1 - {number(a)})) = {number(reduced)}")
        return Step("Chebyshev's bound", quantities, tuple(lines)), reduced
