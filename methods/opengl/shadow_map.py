"""Shadow maps by OpenGL: a depth texture and the comparing sampler of the graphics hardware.

The map is drawn by the rasteriser and looked up with ``sampler2DShadow``, whose comparison is ``d - bias <= z``. With
``filter=nearest`` it is Williams' test of one texel (``shadow-map``), with ``filter=bilinear`` the four comparisons
around the receiver weighted by its place between them (``pcf`` with ``filter=bilinear``): the one filter of comparisons
that graphics hardware has. Hardware rounds the weights to 1/256, llvmpipe does not.

``slope_bias`` is glPolygonOffset's factor, times the footprint's width, as in ``pcf``. What holds for all that OpenGL
draws here (depth, precision, transfers, threads) is said in the package's docstring, ``shadowbench.methods.opengl``.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Literal

from shadowbench.method import LightSpaceKernel
from shadowbench.parameters import parameter
from shadowbench.receivers import Receivers

from .device import OpenglDevice
from .drawing import CasterDrawing
from .look_up import LookUp, ReceiverTextures, at_face
from .peer import OpenglMethod, OpenglParameters

if TYPE_CHECKING:
    import moderngl

_BILINEAR_WIDTH = 2


class OpenglShadowMapParameters(OpenglParameters):
    filter: Literal["nearest", "bilinear"] = parameter(
        "bilinear", unit="1", help="Compare with one texel, or with four and weigh the answers."
    )
    slope_bias: float = parameter(
        1.0, unit="texels", help="Polygon offset in texels of slope, times the footprint.", ge=0.0, le=64.0
    )


class OpenglShadowMap(OpenglMethod):
    """A depth texture and a comparing sampler."""

    name = "opengl-shadow-map"
    title = "Shadow maps by OpenGL"
    source = "Williams 1978; Reeves, Salesin & Cook 1987; OpenGL through moderngl"
    Parameters = OpenglShadowMapParameters

    parameters: OpenglShadowMapParameters

    def make_drawing(self, device: OpenglDevice) -> CasterDrawing:
        width = _BILINEAR_WIDTH if self.parameters.filter == "bilinear" else 1
        return CasterDrawing(device, slope_bias=self.parameters.slope_bias * width)

    def make_maps(self, device: OpenglDevice, faces: int) -> None:
        gl, size = device.gl, self.parameters.resolution
        self._maps = [gl.depth_texture((size, size)) for _ in range(faces)]
        self._targets = [gl.framebuffer(depth_attachment=texture) for texture in self._maps]
        way = gl.LINEAR if self.parameters.filter == "bilinear" else gl.NEAREST
        self._sampler = gl.sampler(repeat_x=False, repeat_y=False, filter=(way, way), compare_func="<=")

    def make_look_up(self, device: OpenglDevice, receivers: ReceiverTextures, faces: int) -> LookUp:
        return LookUp(
            device,
            receivers,
            faces,
            sampler_type="sampler2DShadow",
            functions=at_face("float lit(vec3 at)", "textureLod({map}, at, 0.0)", faces),
            statements="result = lit(face, vec3(at, d));",
            uniforms={"bias": self.parameters.bias},
        )

    def targets(self) -> Sequence[moderngl.Framebuffer]:
        return self._targets

    def sampled(self) -> tuple[Sequence[moderngl.Texture], moderngl.Sampler]:
        return self._maps, self._sampler

    def bytes_of_maps(self) -> dict[str, int]:
        return {"shadow map": 4 * self.parameters.resolution**2 * len(self._maps)}

    def kernel(self, receivers: Receivers) -> LightSpaceKernel | None:
        if self.parameters.filter == "nearest":
            return None
        return LightSpaceKernel("bilinear", float(_BILINEAR_WIDTH), self.parameters.resolution)
