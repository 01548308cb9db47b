"""Shadow maps (Williams 1978): draw the scene's depth from the light, compare each receiver with the nearest texel.

The map stores linear depth at texel centres; a receiver anywhere in the texel is compared with that one number, so a
surface slanted to the light shadows itself (*acne*) unless a bias keeps the comparison off. Four biases, which add up:

* ``bias``, constant: the receiver is moved towards the light. Too small leaves acne, too large detaches shadows from
  what casts them (*peter-panning*).
* ``slope_bias``: polygon offset when the map is drawn; stored depths grow by this many texels' worth of the caster's
  larger depth slope. 1 is exactly what a plane needs, since a receiver is at most half a texel from the centre along
  each axis.
* ``receiver_plane``: the depth compared is the receiver's plane's at the texel's centre; clamped as the plane turns
  edge-on.
* ``normal_offset``: the look-up's position moves along the surface normal (Holbert 2011).

Limits: resolution. Shadow edges are as wrong as a texel is large, and casters thinner than a texel drop out. Point
lights take six maps. Cost: drawing every caster once a map; one texel a receiver.
"""

from __future__ import annotations

import math
from typing import Any, ClassVar

import numpy as np
import warp as wp

from shadowbench.account import Account, Quantity, Step, number, plain
from shadowbench.depth_map_method import MAP_COUNTERS, DepthMapMethod, DepthMapParameters
from shadowbench.device.launch import launch
from shadowbench.method import Trace
from shadowbench.methods.shadow_map.kernels import compare_nearest_texel
from shadowbench.parameters import parameter
from shadowbench.receivers import Receivers


class ShadowMapParameters(DepthMapParameters):
    slope_bias: float = parameter(
        1.0, unit="texels", help="Polygon offset: stored depths grow by this many texels of slope.", ge=0.0, le=64.0
    )
    receiver_plane: bool = parameter(
        False, unit="1", help="Compare with the depth of the receiver's plane at the texel's centre."
    )
    normal_offset: float = parameter(
        0.0,
        unit="texels",
        help="Move the look-up along the normal, by this times the sine to the light.",
        ge=0.0,
        le=64.0,
    )


class ShadowMap(DepthMapMethod):
    """Williams' depth test against the nearest texel."""

    name = "shadow-map"
    title = "Shadow maps"
    source = "Williams 1978; biases: Reeves et al. 1987 and Holbert 2011"
    Parameters = ShadowMapParameters
    counters: ClassVar[dict[str, str]] = {
        **MAP_COUNTERS,
        "texels compared": "texels looked up, over all valid receivers",
    }

    parameters: ShadowMapParameters

    def polygon_offset(self) -> float:
        return self.parameters.slope_bias

    def shade(self, receivers: Receivers, visibility: wp.array[Any], trace: Trace) -> None:
        on_device = receivers.on(self.context.device)
        with trace.stage("look-up"):
            launch(
                compare_nearest_texel,
                receivers.count,
                inputs=[
                    self.lookup,
                    on_device.position,
                    on_device.normal,
                    self.parameters.bias,
                    self.parameters.normal_offset,
                    float(self.parameters.receiver_plane),
                ],
                outputs=[visibility],
                context=self.context,
            )
        trace.count("texels compared", int(receivers.valid.sum()))

    def account(self, receivers: Receivers, index: int) -> Account:
        from shadowbench.map_account import depth_tests, known_account, place_in_map

        p, receiver = self.parameters, receivers.only(index)
        place = place_in_map(
            self.lookup, receiver, self.context, normal_offset=p.normal_offset, plane=float(p.receiver_plane)
        )
        if place.state >= 0:
            return known_account(place)
        _, steps = self.account_before_test(receiver, 3)
        texel = np.array([[math.floor(place.x), math.floor(place.y)]])
        tests = depth_tests(self.lookup, place.point, texel, p.bias, self.context)
        compared, stored, is_lit = float(tests.compared[0]), float(tests.stored[0]), float(tests.is_lit[0])
        quantities = (
            Quantity("texel", plain(texel[0]), "column, row"),
            Quantity("receiver depth", place.depth, "depth"),
            Quantity("bias", p.bias, "depth"),
            Quantity("polygon offset the map was drawn with", p.slope_bias, "texels of slope"),
            Quantity("normal offset", p.normal_offset, "texels"),
            Quantity("plane's depth at the texel's centre", compared + p.bias - place.depth, "depth from the receiver"),
            Quantity("stored depth", stored, "depth"),
        )
        formula = (
            f"d - bias = {number(place.depth)} - {number(p.bias)}"
            + (" + slopes · (centre - place)" if p.receiver_plane else "")
            + f" = {number(compared)}",
            f"{number(compared)} {'<=' if is_lit else '>'} z = {number(stored)}: "
            + (f"lit by {number(stored - compared)}" if is_lit else f"shadowed by {number(compared - stored)}"),
        )
        return Account((*steps, Step("comparison", quantities, formula)), is_lit)
