"""Percentage-closer filtering (Reeves, Salesin & Cook 1987): filter the comparisons, never the depths.

Every texel of the footprint is compared with the receiver first, and the weighted mean of the answers is the
visibility. ``filter`` says which weights: ``bilinear`` (2x2, as graphics hardware compares), ``box`` (K x K equal
weights) or ``gauss`` (K x K). An odd footprint is centred on the texel that holds the receiver, an even one on the
texel corner nearest to it, so K taps along each axis and weights that sum to 1 in both cases.

``footprint`` says where the taps lie. With ``texels`` they are K x K neighbours in the map, whatever the view. With
``pixel``, as published, they are spread over the part of the receiver's surface that its pixel covers: K x K points of
its plane, each compared with the texel that holds it. Sides of the pixel shorter than a texel are lengthened to one,
so that a magnified map is filtered as by interpolation, and not at all points of one texel alike.

The biases are those of ``shadow-map``. Over texels they are scaled with the footprint, since a plane needs more the
farther the farthest tap: with footprint K the polygon offset and the normal offset are K times the parameter, and 1 is
again exactly what a plane needs. ``receiver_plane`` follows the plane to each tap instead. Points of the surface have
its depths already and need what a shadow map needs.

Limits: the penumbra is as wide as the kernel, not as the light; at silhouettes the scaled bias detaches contact
shadows. Cost: K² texels a receiver, whatever the map's size.
"""

from __future__ import annotations

from typing import Any, ClassVar, Literal

import numpy as np
import warp as wp
from pydantic import model_validator

from shadowbench.account import Account, Quantity, Step, number
from shadowbench.depth_map_method import MAP_COUNTERS, DepthMapMethod, DepthMapParameters
from shadowbench.device.arrays import as_warp
from shadowbench.device.filter_weights import gauss_sigma, tap_weights
from shadowbench.device.filtered_lookup import pixel_points
from shadowbench.device.launch import launch
from shadowbench.method import LightSpaceKernel, Trace
from shadowbench.methods.pcf.kernels import filter_bilinear, filter_over_pixel, filter_weighted
from shadowbench.parameters import parameter
from shadowbench.receivers import Receivers


class PcfParameters(DepthMapParameters):
    filter: Literal["bilinear", "box", "gauss"] = parameter(
        "box", unit="1", help="Weights: 2x2 bilinear, equal, or Gaussian."
    )
    kernel: int = parameter(
        3, unit="texels", help="Width of the footprint, odd or even; bilinear is always 2.", ge=1, le=63
    )
    footprint: Literal["texels", "pixel"] = parameter(
        "texels", unit="1", help="Where the taps lie: side by side in the map, or over the pixel's part of the surface."
    )
    slope_bias: float = parameter(
        1.0, unit="texels", help="Polygon offset in texels of slope, times a footprint of texels.", ge=0.0, le=64.0
    )
    receiver_plane: bool = parameter(
        False, unit="1", help="Compare each tap with the depth of the receiver's plane there."
    )
    normal_offset: float = parameter(
        0.0, unit="texels", help="Move the look-up along the normal: this times sine times footprint.", ge=0.0, le=64.0
    )

    @model_validator(mode="before")
    @classmethod
    def _bilinear_is_two_wide(cls, values: Any) -> Any:
        if isinstance(values, dict) and values.get("filter") == "bilinear":
            if str(values.get("kernel", 2)) != "2":
                raise ValueError(f"a bilinear filter's kernel is 2 texels wide, not {values['kernel']}")
            if values.get("footprint") == "pixel":
                raise ValueError("a bilinear filter lies between texels; over a pixel the weights are box or gauss")
            return {**values, "kernel": 2}
        return values


class PercentageCloserFiltering(DepthMapMethod):
    """The weighted mean of depth tests over a footprint of texels."""

    name = "pcf"
    title = "Percentage-closer filtering"
    source = "Reeves, Salesin & Cook 1987"
    Parameters = PcfParameters
    counters: ClassVar[dict[str, str]] = {
        **MAP_COUNTERS,
        "texels compared": "taps over all valid receivers",
    }

    parameters: PcfParameters

    def polygon_offset(self) -> float:
        return self.parameters.slope_bias * self._bias_scale

    @property
    def _bias_scale(self) -> int:
        """Texels between the farthest taps that are compared with one depth, and one more."""
        return 1 if self.parameters.footprint == "pixel" else self.parameters.kernel

    def shade(self, receivers: Receivers, visibility: wp.array[Any], trace: Trace) -> None:
        p = self.parameters
        points = pixel_points(receivers.on(self.context.device))
        inputs = [self.lookup, points, p.bias, p.normal_offset * self._bias_scale, float(p.receiver_plane)]
        kernel = filter_bilinear
        if p.filter != "bilinear":
            kernel = filter_over_pixel if p.footprint == "pixel" else filter_weighted
            weights = tap_weights(p.filter, p.kernel).astype(np.float32)
            inputs.append(as_warp(weights, wp.float32, self.context.device))
        with trace.stage("look-up"):
            launch(kernel, receivers.count, inputs=inputs, outputs=[visibility], context=self.context)
        trace.count("texels compared", int(receivers.valid.sum()) * p.kernel**2)

    def account(self, receivers: Receivers, index: int) -> Account:
        from shadowbench.device.shadow_lookup import MapPoint
        from shadowbench.map_account import depth_tests, known_account
        from shadowbench.methods.pcf.account_kernels import tell_taps_in_map, tell_taps_over_pixel

        p, receiver, device = self.parameters, receivers.only(index), self.context.device
        place, steps = self.account_before_test(receiver, p.kernel)
        if place.state >= 0:
            return known_account(place)
        weights = tap_weights("box" if p.filter == "bilinear" else p.filter, p.kernel).astype(np.float32)
        taps = wp.zeros(p.kernel**2, dtype=MapPoint, device=device)
        texel = wp.zeros(p.kernel**2, dtype=wp.vec2i, device=device)
        mean = wp.zeros(2, dtype=wp.float32, device=device)
        points = pixel_points(receiver.on(device))
        inputs = [self.lookup, points, p.bias, p.normal_offset * self._bias_scale, float(p.receiver_plane)]
        kernel = tell_taps_over_pixel if p.footprint == "pixel" else tell_taps_in_map
        inputs.append(as_warp(weights, wp.float32, device))
        launch(kernel, 1, inputs=inputs, outputs=[taps, texel, mean], context=self.context)
        tests = depth_tests(self.lookup, taps, texel.numpy(), p.bias, self.context)
        of_taps = np.outer(weights, weights).reshape(-1)
        if p.filter == "bilinear":
            right, down = (taps.numpy()[axis][0] - 0.5 - tests.texel[0, k] for k, axis in enumerate("xy"))
            of_taps = np.outer([1.0 - down, down], [1.0 - right, right]).reshape(-1)
        result = float(mean.numpy()[1 if p.filter == "bilinear" else 0])
        lit = int(tests.is_lit.sum())
        quantities = (
            Quantity("receiver depth", float(taps.numpy()["depth"][0]), "depth"),
            Quantity("bias", p.bias, "depth"),
            Quantity("polygon offset the map was drawn with", self.polygon_offset(), "texels of slope"),
            Quantity("normal offset", p.normal_offset * self._bias_scale, "texels"),
            Quantity("taps that are lit", f"{lit} of {len(of_taps)}"),
        )
        formula = (
            "a tap is lit where its compared depth <= the stored one",
            f"visibility = sum of weights of lit taps = {number(result)}",
        )
        table = tests.table("taps", of_taps)
        return Account((*steps, Step("weighted mean of depth tests", quantities, formula, table)), result)

    def kernel(self, receivers: Receivers) -> LightSpaceKernel:
        """Return the window of texels or, of taps over a pixel, what they amount to where a map is magnified."""
        p = self.parameters
        if p.footprint == "pixel":
            return LightSpaceKernel("bilinear", 2.0, p.resolution)
        sigma = gauss_sigma(p.kernel) if p.filter == "gauss" else 0.0
        return LightSpaceKernel(shape=p.filter, width=float(p.kernel), resolution=p.resolution, sigma=sigma)
