"""The separable Gauss blur of a map, as two passes of a fragment shader over a texture as large as the map."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from .device import OpenglDevice

if TYPE_CHECKING:
    import moderngl

_SHADER = """
#version 330
uniform sampler2D source;
out %(kind)s mean;
%(kind)s tap(vec2 at) { return textureLod(source, at, 0.0).%(channels)s; }
void main() {
    vec2 at = gl_FragCoord.xy * %(texel)r;
    mean = %(sum)s;
}
"""


def gauss_sigma(width: int) -> float:
    """Standard deviation of a Gauss kernel of ``width`` taps [texels]: the rule of OpenCV's ``getGaussianKernel``."""
    return 0.3 * ((width - 1) * 0.5 - 1.0) + 0.8


def gauss_half(width: int) -> list[float]:
    """Weights of the middle tap and of those to its right; with those to its left they sum to 1."""
    values = [math.exp(-0.5 * (k / gauss_sigma(width)) ** 2) for k in range(width // 2 + 1)]
    total = values[0] + 2.0 * math.fsum(values[1:])
    return [value / total for value in values]


class Convolution:
    """A Gauss blur of square textures.

    Args:
        device: Where; current whenever something here is used.
        resolution: Width and height [texels].
        width: Odd number of taps along each axis.
        components: Channels of a texel, 1 or 2.
    """

    def __init__(self, device: OpenglDevice, resolution: int, *, width: int, components: int) -> None:
        self._nearest = device.nearest
        self._rows = device.covering_pass(_blur("vec2({0!r}, 0.0)", resolution, width, components), source=0)
        self._columns = device.covering_pass(_blur("vec2(0.0, {0!r})", resolution, width, components), source=0)
        self._half_way = device.gl.texture((resolution, resolution), components, dtype="f4")
        self._target = device.gl.framebuffer([self._half_way])
        self.byte_count = 4 * components * resolution**2

    def run(self, texture: moderngl.Texture, target: moderngl.Framebuffer) -> None:
        """Blur the base level of a texture, which is the target's only attachment, in place."""
        self._rows.run(self._target, (texture, self._nearest))
        self._columns.run(target, (self._half_way, self._nearest))


def _blur(offset: str, resolution: int, width: int, components: int) -> str:
    """Return the shader of one pass: taps and weights written out, which is what compilers make the most of."""
    half = gauss_half(width)
    taps = range(-(width // 2), width // 2 + 1)
    terms = [f"{half[abs(k)]!r} * tap(at + {offset.format(k / resolution)})" for k in taps]
    kind, channels = ("float", "r") if components == 1 else ("vec2", "rg")
    return _SHADER % {"kind": kind, "channels": channels, "texel": 1.0 / resolution, "sum": "\n        + ".join(terms)}
