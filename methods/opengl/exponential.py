"""Exponential shadow maps by OpenGL (Annen et al. 2008), as the paper's section on implementation has them.

The rasteriser stores e^(c z) in a float texture; blurring and mip-mapping it blurs shadows, since the visibility is
min(1, e^(-c d) times what the filter gives). It holds where no filtered depth lies behind the receiver; where one does,
the product exceeds 1 and ``classification=threshold`` (more than 1 + ``epsilon``) has the fragment shader fall back:
the bilinear weights times the four nearest texels' own clamped tests, on the map that is kept, the blurred one.

Limits: light leaks where caster and receiver are close (e^(-c times their distance)); c is at most 87, beyond which
float32 overflows. The paper's other classification, by the largest depth under the filter, is not here: OpenGL has no
maximum filter of textures. What holds for all that OpenGL draws here (depth, precision, transfers, threads) is said in
the package's docstring, ``shadowbench.methods.opengl``.
"""

from __future__ import annotations

import math
from typing import Literal

import numpy as np

from shadowbench.method import Trace
from shadowbench.parameters import parameter
from shadowbench.receivers import Receivers

from .drawing import Color
from .filtered import FilteredMethod, FilteredParameters
from .look_up import at_face

_TESTS = """
float test(int face, ivec2 texel, float d) {  // one texel's, clamped
    ivec2 last = ivec2(int(resolution) - 1);
    return min(exp(-c * d) * stored(face, clamp(texel, ivec2(0), last)), 1.0);
}

float fallback(int face, vec2 at, float d) {  // the bilinear mean of four tests
    vec2 place = at * resolution - 0.5;
    ivec2 texel = ivec2(floor(place));
    vec2 share = place - floor(place);
    float first = mix(test(face, texel, d), test(face, texel + ivec2(1, 0), d), share.x);
    float second = mix(test(face, texel + ivec2(0, 1), d), test(face, texel + ivec2(1, 1), d), share.x);
    return mix(first, second, share.y);
}
"""


class ExponentialParameters(FilteredParameters):
    c: float = parameter(
        80.0, unit="1", help="c of e^(c z): larger leaks less; float32 overflows beyond 87.", gt=0.0, le=87.0
    )
    classification: Literal["none", "threshold"] = parameter(
        "threshold", unit="1", help="Which receivers fall back to four tests: none, or those above 1 + epsilon."
    )
    epsilon: float = parameter(0.05, unit="1", help="How far above 1 a filtered test may lie.", ge=0.0, le=100.0)


class OpenglExponential(FilteredMethod):
    """A float texture of exponentials, blurred and with a mip chain."""

    name = "opengl-esm"
    title = "Exponential shadow maps by OpenGL"
    source = "Annen et al. 2008; OpenGL through moderngl"
    Parameters = ExponentialParameters
    map_name = "exponential map"

    parameters: ExponentialParameters

    def uniforms(self) -> dict[str, float]:
        return {"c": self.parameters.c, "epsilon": self.parameters.epsilon}

    def stored(self) -> str:
        return f"stored = exp({self.parameters.c!r} * z);"

    def empty(self) -> Color:
        return (math.exp(self.parameters.c), 0.0, 0.0, 0.0)

    def functions(self, faces: int) -> str:
        if self.parameters.classification == "none":
            return ""
        return at_face("float stored(ivec2 texel)", "texelFetch({map}, texel, 0).r", faces) + _TESTS

    def statements(self) -> str:
        lines = ["result = exp(-c * d) * moments.r;"]
        if self.parameters.classification == "threshold":
            lines.append("if (result > 1.0 + epsilon) result = fallback(face, at, d);")
        return "\n    ".join([*lines, "result = min(result, 1.0);"])

    def explain(self, receivers: Receivers, trace: Trace) -> None:
        """Mark the receivers that fall back, by another pass."""
        if self.parameters.classification == "none" or self._device is None:
            return
        with self._device as device:
            statements = "result = exp(-c * d) * moments.r > 1.0 + epsilon ? 1.0 : 0.0;"
            classify = self.look_up_that(device, self._receivers, len(self._frames), statements, unreached=0.0)
            classify.run(self._light, self._frames, *self.sampled())
            failing = np.empty(receivers.count, np.float32)
            self._receivers.read(failing)
        trace.mask("classified", (failing > 0.5) & receivers.valid)
