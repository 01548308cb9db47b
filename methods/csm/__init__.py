"""Convolution shadow maps (Annen, Mertens, Bekaert, Seidel & Kautz 2007): the depth test as a Fourier series.

The step function of z - d on [-1, 1] is ½ + 2 Σ sin(c_k (z - d)) / c_k with c_k = π (2k - 1), k = 1 … M; each sine of
a difference is a sum of products of sines and cosines of z and of d alone, so that 2M basis images of sin(c_k z) and
cos(c_k z) can be convolved, mip-mapped and interpolated, and one look-up gives the filtered test.

The truncated series is ½ at z = d and reaches its first peak, 1.09, at z - d = 1 / (2M): ``offset`` moves the receiver
that far towards the light (0.03125 with 16 terms, the paper's 0.032). It rings on both sides of the step;
``attenuation`` A damps term k by e^(-A (k / M)²). ``basis`` says how the images are stored: in 8 bits, as published,
or as floats.

Limits: the offset loses shadows at contacts, the ringing is clamped where lit and seen where dark, and the series has
period 2, so that receivers within 1 / (2M) of the near plane darken under an empty map. Cost: 2M values a texel, 4/3
of that with mip levels, all of them filtered and looked up.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import warp as wp

from shadowbench.account import Quantity, Step, Table, number
from shadowbench.device.arrays import as_warp
from shadowbench.device.depth_encodings import encode_fourier_terms
from shadowbench.filtered_map_method import FilteredMapMethod, FilteredMapParameters
from shadowbench.method import Trace
from shadowbench.methods.csm.kernels import look_up_bytes, look_up_floats
from shadowbench.parameters import parameter
from shadowbench.receivers import Receivers

if TYPE_CHECKING:
    from shadowbench.map_account import LookedUp


class CsmParameters(FilteredMapParameters):
    terms: int = parameter(16, unit="1", help="Terms M of the series, of two basis images each.", ge=1, le=32)
    basis: Literal["8-bit", "float"] = parameter("8-bit", unit="1", help="How the basis images are stored.")
    offset: float = parameter(
        0.03125, unit="depth", help="Taken off the receiver's depth besides the bias; 1 / (2 terms).", ge=0.0, le=1.0
    )
    attenuation: float = parameter(
        0.0, unit="1", help="Damping of the ringing: term k by e to minus this times (k / terms)².", ge=0.0, le=100.0
    )


class ConvolutionShadowMaps(FilteredMapMethod):
    """A Fourier series a texel, filtered beforehand."""

    name = "csm"
    title = "Convolution shadow maps"
    source = "Annen et al. 2007"
    Parameters = CsmParameters
    map_name = "basis images"

    parameters: CsmParameters

    def texel_format(self) -> tuple[int, Any]:
        return 2 * self.parameters.terms, wp.float32 if self.parameters.basis == "float" else wp.uint8

    def encode(self, depth: wp.array[Any], target: wp.array[Any]) -> None:
        encode_fourier_terms(depth, target, self.parameters.terms, self.context)

    def shade(self, receivers: Receivers, visibility: wp.array[Any], trace: Trace) -> None:
        p = self.parameters
        kernel = look_up_floats if p.basis == "float" else look_up_bytes
        self.look_up(kernel, receivers, [visibility], trace, arguments=self._arguments(), bias=p.bias + p.offset)

    def _arguments(self) -> tuple[wp.array[Any], float, float]:
        """Return the terms' scales, and the unit and the zero of what is stored."""
        p = self.parameters
        unit, zero = (1.0, 0.0) if p.basis == "float" else (2.0 / 255.0, 1.0)
        k = np.arange(1, p.terms + 1)
        damped = 2.0 / (math.pi * (2 * k - 1)) * np.exp(-p.attenuation * (k / p.terms) ** 2)
        return as_warp(damped.astype(np.float32), wp.float32, self.context.device), unit, zero

    def channel_names(self) -> tuple[str, ...]:
        return tuple(f"sin {k}" for k in range(1, min(self.parameters.terms, 3) + 1))

    def account_of_mean(self, receiver: Receivers, averaged: LookedUp) -> tuple[Step, float]:
        from shadowbench.methods.csm.account_kernels import tell_bytes, tell_floats

        p, (scales, unit, zero) = self.parameters, self._arguments()
        kernel = tell_floats if p.basis == "float" else tell_bytes
        told = self.tell(
            kernel, receiver, 4 + 2 * p.terms, arguments=(scales, unit, zero), bias=p.bias + p.offset
        ).astype(np.float64)
        depth, _, series, result = (float(value) for value in told[:4])
        stored = self.chain.values.numpy()[averaged.index[:, None] + np.arange(2 * p.terms)]
        mean = averaged.weight @ stored.astype(np.float64) * unit - zero
        # a stored value v stands for unit v - zero; the constant holds what the zeros add up to
        weight = told[4:] / unit
        sine, cosine = weight[: p.terms] * mean[: p.terms], weight[p.terms :] * mean[p.terms :]
        terms = tuple(
            (
                k + 1,
                math.pi * (2 * k + 1),
                *(float(part[k]) for part in (mean[: p.terms], mean[p.terms :], sine + cosine)),
            )
            for k in range(p.terms)
        )
        quantities = (
            Quantity("receiver depth d, less bias and offset", depth, "depth"),
            Quantity("offset", p.offset, "depth"),
            Quantity("terms", p.terms),
            Quantity("sum of the terms", float((sine + cosine).sum())),
        )
        formula = (
            f"series = 1/2 + sum of the terms = {number(series)}",
            f"visibility = clamp(series) = {number(result)}",
        )
        columns = ("k", "c_k", "mean sin(c_k z)", "mean cos(c_k z)", "term")
        return Step("Fourier series of the depth test", quantities, formula, Table("terms", columns, terms)), result
