"""Variance shadow maps by OpenGL (Donnelly & Lauritzen 2006).

The rasteriser stores (z, z²) in a float texture; after any filter they are the mean and the mean square of depths, and
Chebyshev's inequality bounds the lit share: 1 where d is at most the mean, else σ² / (σ² + (d - mean)²), with σ² at
least ``minimum_variance``. ``slope_term`` adds a quarter of the squared depth slope, the variance within a texel;
``bleeding_reduction`` a maps the result from [a, 1] to [0, 1] and cuts off what is below.

Limits: light leaks where casters lie behind one another, since the bound is only exact for one. What holds for all that
OpenGL draws here (depth, precision, transfers, threads) is said in the package's docstring,
``shadowbench.methods.opengl``.
"""

from __future__ import annotations

from typing import ClassVar

from shadowbench.parameters import parameter

from .drawing import Color
from .filtered import FilteredMethod, FilteredParameters


class VarianceParameters(FilteredParameters):
    minimum_variance: float = parameter(
        1.0e-6, unit="depth²", help="Variance is at least this: larger hides acne, and leaks.", ge=0.0, le=1.0
    )
    bleeding_reduction: float = parameter(
        0.0, unit="1", help="Visibility up to this becomes 0, and the rest is stretched.", ge=0.0, lt=1.0
    )
    slope_term: bool = parameter(False, unit="1", help="Add a quarter of the squared depth slope to the mean square.")


class OpenglVariance(FilteredMethod):
    """A float texture of depths and their squares, blurred and with a mip chain."""

    name = "opengl-vsm"
    title = "Variance shadow maps by OpenGL"
    source = "Donnelly & Lauritzen 2006; OpenGL through moderngl"
    Parameters = VarianceParameters
    components: ClassVar[int] = 2
    map_name = "moment map"

    parameters: VarianceParameters

    def uniforms(self) -> dict[str, float]:
        p = self.parameters
        return {"minimum_variance": p.minimum_variance, "bleeding_reduction": p.bleeding_reduction}

    def stored(self) -> str:
        if self.parameters.slope_term:
            return "vec2 slope = vec2(dFdx(z), dFdy(z)); stored = vec2(z, z * z + 0.25 * dot(slope, slope));"
        return "stored = vec2(z, z * z);"

    def empty(self) -> Color:
        return (1.0, 1.0, 0.0, 0.0)

    def statements(self) -> str:
        return """float beyond = d - moments.r;
    float variance = max(moments.g - moments.r * moments.r, minimum_variance);
    result = beyond <= 0.0 ? 1.0 : variance / (variance + beyond * beyond);
    result = clamp((result - bleeding_reduction) / (1.0 - bleeding_reduction), 0.0, 1.0);"""
