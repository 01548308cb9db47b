"""Looking receivers up in a light's maps: their textures, the fragment shader around a method's test, the read-back."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from shadowbench.light_space import Frame
from shadowbench.receivers import Receivers
from shadowbench.scene import Light, PointLight

from .device import OpenglDevice

if TYPE_CHECKING:
    import moderngl

_SHADER = """
#version 330
const int FACES = %(faces)d;
uniform mat4 projection[FACES];  // to (u w, v w, depth, w)
uniform float near;              // nothing nearer than this is in a map
uniform vec3 light;
uniform float resolution;
uniform float bias;
uniform sampler2D position;
uniform sampler2D position_dx;
uniform sampler2D position_dy;
%(declarations)s
out float result;

int face_of(vec3 offset) {  // the largest component, of equal ones the first: +x, -x, +y, -y, +z, -z
    vec3 size = abs(offset);
    int axis = size.y > size.x ? 1 : 0;
    if (size.z > size[axis]) axis = 2;
    return 2 * axis + (offset[axis] < 0.0 ? 1 : 0);
}

%(functions)s

void main() {
    ivec2 own = ivec2(gl_FragCoord.xy);
    vec3 p = texelFetch(position, own, 0).xyz;
    int face = FACES == 1 ? 0 : face_of(p - light);
    vec4 h = projection[face] * vec4(p, 1.0);
    if (h.w <= near) {
        result = %(unreached)s;
        return;
    }
    vec2 at = h.xy / h.w;
    float d = h.z - bias;
    %(statements)s
}
"""

GRADIENTS = """
    // how the place in the map changes from pixel to pixel along the receiver's plane
    vec4 hx = projection[face] * vec4(texelFetch(position_dx, own, 0).xyz, 0.0);
    vec4 hy = projection[face] * vec4(texelFetch(position_dy, own, 0).xyz, 0.0);
    vec2 at_dx = (hx.xy - at * hx.w) / h.w;
    vec2 at_dy = (hy.xy - at * hy.w) / h.w;
"""


def at_face(signature: str, expression: str, faces: int) -> str:
    """Return a GLSL function of a map, since samplers cannot be chosen by a variable.

    Args:
        signature: All but the first argument, ``int face``, as in ``float stored(vec2 at)``.
        expression: What it returns, with ``{map}`` for the face's map.
        faces: Number of maps, ``map0`` and so on.
    """
    name, _, arguments = signature.partition("(")
    *cases, last = (expression.format(map=f"map{k}") for k in range(faces))
    lines = [f"    if (face == {k}) return {case};" for k, case in enumerate(cases)]
    return "\n".join([f"{name}(int face, {arguments} {{", *lines, f"    return {last};", "}"])


class ReceiverTextures:
    """Receivers in list order, row by row in textures as wide as the picture, and the result for each.

    Args:
        device: Where; current whenever something here is used.
        has_gradients: Whether how positions change from pixel to pixel is needed too.
        largest: Largest width and height of a texture [texels].
    """

    def __init__(self, device: OpenglDevice, *, has_gradients: bool, largest: int) -> None:
        self._gl = device.gl
        self._largest = largest
        self._names = ["position", *(["position_dx", "position_dy"] if has_gradients else [])]
        self._shape = (0, 0)
        self.textures: list[moderngl.Texture] = []
        self._results: list[moderngl.Texture] = []
        self._targets: list[moderngl.Framebuffer] = []

    @property
    def target(self) -> moderngl.Framebuffer:
        """Where results go; there after the first upload."""
        return self._targets[0]

    @property
    def names(self) -> list[str]:
        """The samplers of :attr:`textures`."""
        return self._names

    @property
    def byte_count(self) -> int:
        """Bytes on the device, the results' included."""
        width, height = self._shape
        return width * height * 4 * (3 * len(self._names) + 1)

    def upload(self, receivers: Receivers) -> None:
        """Replace the receivers.

        Raises:
            RuntimeError: There are more than fit a texture.
        """
        width = min(self._largest, max(receivers.width, -(-receivers.count // self._largest)))
        height = -(-receivers.count // width)
        if height > self._largest:
            raise RuntimeError(f"{receivers.count} receivers do not fit a texture of {self._largest}² texels")
        if self._shape != (width, height):
            self._allocate(width, height)
        for name, texture in zip(self._names, self.textures, strict=True):
            values = np.ascontiguousarray(getattr(receivers, name))
            for first, last, viewport in self._parts(receivers.count):
                texture.write(values[first:last], viewport=viewport)

    def read(self, results: NDArray[np.float32]) -> None:
        """Copy the results to an array, shape [receiver_count]."""
        for first, last, viewport in self._parts(len(results)):
            part = results[first:last]
            self.target.read_into(part, viewport=viewport, components=1, dtype="f4")

    def _parts(self, count: int) -> Sequence[tuple[int, int, tuple[int, int, int, int]]]:
        """Return the whole rows and the rest: first and last receiver, and the rectangle that holds them."""
        width = self._shape[0]
        rows, rest = divmod(count, width)
        parts = [(0, rows * width, (0, 0, width, rows)), (rows * width, count, (0, rows, rest, 1))]
        return [part for part in parts if part[0] < part[1]]

    def _allocate(self, width: int, height: int) -> None:
        for target in self._targets:
            target.release()
        for texture in (*self.textures, *self._results):
            texture.release()
        self.textures = [self._gl.texture((width, height), 3, dtype="f4") for _ in self._names]
        self._results = [self._gl.texture((width, height), 1, dtype="f4")]
        self._targets = [self._gl.framebuffer(self._results)]
        self._shape = (width, height)


class LookUp:
    """The pass that runs a test for every receiver.

    Args:
        device: Where; current whenever something here is used.
        receivers: The receivers' textures.
        faces: Number of maps.
        sampler_type: GLSL type of a map.
        functions: GLSL before ``main``.
        statements: GLSL that sets ``result`` from the receiver's ``face``, its place ``at`` in the map (u, v), and its
            depth ``d`` less the bias.
        unreached: What the result is where the light's maps have nothing.
        uniforms: Of the functions and statements, and ``resolution`` and ``bias``.
    """

    def __init__(
        self,
        device: OpenglDevice,
        receivers: ReceiverTextures,
        faces: int,
        *,
        sampler_type: str = "sampler2D",
        functions: str,
        statements: str,
        unreached: float = 1.0,
        uniforms: dict[str, float],
    ) -> None:
        self._device, self._receivers = device, receivers
        maps = [f"map{k}" for k in range(faces)]
        code = _SHADER % {
            "faces": faces,
            "declarations": "\n".join(f"uniform {sampler_type} {name};" for name in maps),
            "functions": functions,
            "statements": statements,
            "unreached": f"{unreached:.1f}",
        }
        units = {name: unit for unit, name in enumerate([*receivers.names, *maps])}
        self._pass = device.covering_pass(code, **uniforms, **units)

    def run(
        self, light: Light, frames: Sequence[Frame], maps: Sequence[moderngl.Texture], sampler: moderngl.Sampler
    ) -> None:
        """Write the result of every receiver.

        Args:
            light: Where face 0 … 5 of a point light is decided from.
            frames: What the maps were drawn through.
            maps: One a frame.
            sampler: How to sample them.
        """
        program: Any = self._pass.program
        matrices = np.stack([frame.projection.T for frame in frames])
        program["projection"].write(matrices.astype(np.float32).tobytes())
        program["near"] = -1.0 if frames[0].near is None else frames[0].near
        if isinstance(light, PointLight):
            program["light"] = light.position
        nearest = self._device.nearest
        sources = [(texture, nearest) for texture in self._receivers.textures]
        self._pass.run(self._receivers.target, *sources, *((texture, sampler) for texture in maps))
