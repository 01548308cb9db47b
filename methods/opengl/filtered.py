"""Maps that are filtered before they are looked up: what OpenGL's exponential and variance shadow maps share.

A float texture beside the depth buffer holds a function of the depth. It is blurred (``kernel``), gets a mip chain by
glGenerateMipmap, and is looked up as ``filtering`` says: ``nearest`` and ``bilinear`` in its base level; ``trilinear``
at the level of detail of the receiver's pixel in the map, which is log2 of the longer side of its footprint, from the
receiver's own plane; ``anisotropic`` by several trilinear samples along that side, as many as it is longer than the
shorter one. Their places are those of EXT_texture_filter_anisotropic, but written out in the shader: llvmpipe's own
anisotropic filter overrules the gradients it is given by differences between neighbouring texels of the target, which
here are receivers in list order.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from typing import TYPE_CHECKING, ClassVar, Literal

from pydantic import field_validator

from shadowbench.method import LightSpaceKernel, Trace
from shadowbench.parameters import parameter
from shadowbench.receivers import Receivers

from .convolution import Convolution, gauss_sigma
from .device import OpenglDevice
from .drawing import CasterDrawing
from .look_up import GRADIENTS, LookUp, ReceiverTextures, at_face
from .peer import OpenglMethod, OpenglParameters

if TYPE_CHECKING:
    import moderngl


class FilteredParameters(OpenglParameters):
    slope_bias: float = parameter(
        0.0, unit="texels", help="Polygon offset: stored depths grow by this many texels of slope.", ge=0.0, le=64.0
    )
    kernel: int = parameter(5, unit="texels", help="Width of the Gauss blur, odd; 0 for none.", ge=0, le=63)
    filtering: Literal["nearest", "bilinear", "trilinear", "anisotropic"] = parameter(
        "trilinear", unit="1", help="How the map is looked up; the last two through its mip chain."
    )
    anisotropy: int = parameter(10, unit="1", help="Most samples of an anisotropic look-up.", ge=1, le=16)

    @field_validator("kernel")
    @classmethod
    def _is_odd(cls, kernel: int) -> int:
        if kernel and kernel % 2 == 0:
            raise ValueError("a blur's width is odd, or 0 for none")
        return kernel


_SAMPLES = {
    "nearest": "vec4 moments = sampled(face, at, 0.0);",
    "bilinear": "vec4 moments = sampled(face, at, 0.0);",
    "trilinear": f"""{GRADIENTS}
    float side = resolution * max(length(at_dx), length(at_dy));
    vec4 moments = sampled(face, at, log2(max(side, 1.0)));""",
    "anisotropic": f"""{GRADIENTS}
    vec2 sides = resolution * vec2(length(at_dx), length(at_dy));
    float longer = max(sides.x, sides.y);
    float count = clamp(ceil(longer / max(min(sides.x, sides.y), 1e-6)), 1.0, anisotropy);
    float level = log2(max(longer / count, 1.0));
    vec2 along = sides.x > sides.y ? at_dx : at_dy;
    vec4 moments = vec4(0.0);
    for (float k = 1.0; k <= count; k++) moments += sampled(face, at + (k / (count + 1.0) - 0.5) * along, level);
    moments /= count;""",
}


class FilteredMethod(OpenglMethod):
    """A map of a function of the depth, blurred and with a mip chain."""

    components: ClassVar[int] = 1
    map_name: ClassVar[str]

    parameters: FilteredParameters

    @abstractmethod
    def statements(self) -> str:
        """Return GLSL that sets ``result`` from the sampled ``moments`` and the receiver's depth ``d``."""

    def functions(self, faces: int) -> str:
        """Return GLSL functions that the statements call."""
        return ""

    def uniforms(self) -> dict[str, float]:
        """Return the uniforms of the look-up."""
        return {}

    @abstractmethod
    def stored(self) -> str:
        """Return GLSL that sets ``stored`` from the linear depth ``z``."""

    def make_drawing(self, device: OpenglDevice) -> CasterDrawing:
        kind = "float" if self.components == 1 else f"vec{self.components}"
        return CasterDrawing(
            device,
            slope_bias=self.parameters.slope_bias,
            declarations=f"out {kind} stored;",
            statements=self.stored(),
        )

    def make_maps(self, device: OpenglDevice, faces: int) -> None:
        gl, p = device.gl, self.parameters
        size = (p.resolution, p.resolution)
        depth = gl.depth_renderbuffer(size)  # one for all faces: it is not needed once a face is drawn
        self._maps = [gl.texture(size, self.components, dtype="f4") for _ in range(faces)]
        self._targets = [gl.framebuffer([texture], depth) for texture in self._maps]
        self._blur_targets = [gl.framebuffer([texture]) for texture in self._maps]
        self._convolution = None
        if p.kernel > 1:
            self._convolution = Convolution(device, p.resolution, width=p.kernel, components=self.components)
        way = gl.NEAREST if p.filtering == "nearest" else gl.LINEAR
        self._sampler = gl.sampler(
            repeat_x=False,
            repeat_y=False,
            filter=(gl.LINEAR_MIPMAP_LINEAR if self.has_levels else way, way),
        )

    def make_look_up(self, device: OpenglDevice, receivers: ReceiverTextures, faces: int) -> LookUp:
        return self.look_up_that(device, receivers, faces, self.statements())

    def look_up_that(
        self,
        device: OpenglDevice,
        receivers: ReceiverTextures,
        faces: int,
        statements: str,
        *,
        unreached: float = 1.0,
    ) -> LookUp:
        """Return a look-up that samples the maps and goes on with statements of its own."""
        p, uniforms = self.parameters, self.uniforms()
        declarations = [f"uniform float {name};" for name in (*uniforms, "anisotropy")]
        sampled = at_face("vec4 sampled(vec2 at, float level)", "textureLod({map}, at, level)", faces)
        functions = [*declarations, sampled, self.functions(faces)]
        return LookUp(
            device,
            receivers,
            faces,
            functions="\n".join(functions),
            statements=f"{_SAMPLES[p.filtering]}\n    {statements}",
            unreached=unreached,
            uniforms={"resolution": p.resolution, "bias": p.bias, "anisotropy": p.anisotropy, **uniforms},
        )

    @property
    def has_levels(self) -> bool:
        """Whether the maps have mip chains."""
        return self.parameters.filtering in ("trilinear", "anisotropic")

    @property
    def has_gradients(self) -> bool:  # type: ignore[override]
        """Whether the look-up needs to know how receivers change from pixel to pixel."""
        return self.has_levels

    def targets(self) -> Sequence[moderngl.Framebuffer]:
        return self._targets

    def filter_maps(self, device: OpenglDevice, trace: Trace) -> None:
        if self._convolution is not None:
            with device.stage(trace, "convolution"):
                for texture, target in zip(self._maps, self._blur_targets, strict=True):
                    self._convolution.run(texture, target)
        if self.has_levels:
            with device.stage(trace, "mip chain"):
                for texture in self._maps:
                    texture.build_mipmaps()

    def sampled(self) -> tuple[Sequence[moderngl.Texture], moderngl.Sampler]:
        return self._maps, self._sampler

    def bytes_of_maps(self) -> dict[str, int]:
        size, faces = self.parameters.resolution, len(self._maps)
        level_count = size.bit_length() if self.has_levels else 1
        texels = sum(max(1, size >> level) ** 2 for level in range(level_count))
        found = {self.map_name: 4 * self.components * texels * faces, "depth buffer": 4 * size**2}
        if self._convolution is not None:
            found["half-blurred map"] = self._convolution.byte_count
        return found

    def kernel(self, receivers: Receivers) -> LightSpaceKernel | None:
        p = self.parameters
        if p.kernel < 2 and p.filtering == "nearest":
            return None
        if p.kernel < 2:
            return LightSpaceKernel("bilinear", 2.0, p.resolution)
        return LightSpaceKernel("gauss", float(p.kernel), p.resolution, gauss_sigma(p.kernel))
