"""Drawing casters into a light's maps.

The vertex shader computes the linear depth beside the position. Where the frame is orthographic the rasteriser
interpolates the same depth, and what is stored leaves the early depth test alone; where it is a perspective one the
fragment shader writes it. Polygon offset is OpenGL's own in the first case and its formula in the second.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from shadowbench.light_space import Frame
from shadowbench.world import Casters

from .device import OpenglDevice

if TYPE_CHECKING:
    import moderngl

Color = tuple[float, float, float, float]
NOTHING: Color = (0.0, 0.0, 0.0, 0.0)

_VERTEX_SHADER = """
#version 330
uniform mat4 clip_from_world;
uniform vec4 depth_from_world;
in vec3 position;
out float depth;
void main() {
    gl_Position = clip_from_world * vec4(position, 1.0);
    depth = dot(depth_from_world, vec4(position, 1.0));
}
"""

_NOTHING_BUT_DEPTH = "#version 330\nvoid main() {}\n"

_FRAGMENT_SHADER = """
#version 330
in float depth;
%(declarations)s
void main() {
    float z = %(depth)s;
    %(statements)s
}
"""

_OFFSET_DEPTH = "min(depth + %r * max(abs(dFdx(depth)), abs(dFdy(depth))), 1.0)"


class CasterDrawing:
    """The casters' triangles on the device, and the programs that draw them.

    Args:
        device: Where; current whenever something here is used.
        slope_bias: Polygon offset's factor: stored depths grow by this many texels' worth of the larger depth slope.
        declarations, statements: GLSL that writes what is stored beside depth, from the linear depth ``z``, its offset
            included; empty to store depth alone.
    """

    def __init__(
        self,
        device: OpenglDevice,
        *,
        slope_bias: float,
        declarations: str = "",
        statements: str = "",
    ) -> None:
        self._device = device
        self._slope_bias = slope_bias
        self._declarations, self._statements = declarations, statements
        self._programs: dict[bool, moderngl.Program] = {}
        self._arrays: dict[bool, moderngl.VertexArray] = {}
        self._buffers: list[moderngl.Buffer] = []

    @property
    def triangle_count(self) -> int:
        """Number of triangles on the device."""
        return self._buffers[1].size // 12 if self._buffers else 0

    @property
    def byte_count(self) -> int:
        """Bytes of the triangles on the device."""
        return sum(buffer.size for buffer in self._buffers)

    def upload(self, casters: Casters) -> None:
        """Replace the triangles."""
        for array in self._arrays.values():
            array.release()
        for buffer in self._buffers:
            buffer.release()
        self._arrays.clear()
        self._buffers = []
        if casters.triangle_count:
            geometry = (casters.vertices, casters.triangles)
            self._buffers = [self._device.gl.buffer(np.ascontiguousarray(numbers)) for numbers in geometry]

    def draw(self, frame: Frame, target: moderngl.Framebuffer, *, empty: Color = NOTHING) -> None:
        """Clear a map and draw all triangles into it.

        Args:
            frame: The light's view.
            target: Depth, and what is stored beside it.
            empty: What is stored where nothing is drawn.
        """
        gl = self._device.gl
        target.use()
        target.clear(color=empty, depth=1.0)
        if not self._buffers:
            return
        program = self._program(frame.is_orthographic)
        program["clip_from_world"].write(_column_major(_clip_from_world(frame)))  # type: ignore[union-attr]
        if "depth_from_world" in program:
            program["depth_from_world"].write(frame.projection[2].astype(np.float32).tobytes())  # type: ignore[union-attr]
        gl.enable_only(gl.DEPTH_TEST)
        gl.polygon_offset = (self._slope_bias, 0.0) if frame.is_orthographic else (0.0, 0.0)
        self._array(frame.is_orthographic).render(gl.TRIANGLES)

    def _program(self, is_orthographic: bool) -> moderngl.Program:
        if is_orthographic not in self._programs:
            statements = self._statements if is_orthographic else f"gl_FragDepth = z;\n    {self._statements}"
            code = _NOTHING_BUT_DEPTH
            if statements:
                code = _FRAGMENT_SHADER % {
                    "declarations": self._declarations,
                    "depth": _OFFSET_DEPTH % self._slope_bias if self._slope_bias else "depth",
                    "statements": statements,
                }
            self._programs[is_orthographic] = self._device.program(_VERTEX_SHADER, code)
        return self._programs[is_orthographic]

    def _array(self, is_orthographic: bool) -> moderngl.VertexArray:
        if is_orthographic not in self._arrays:
            vertices, triangles = self._buffers
            program = self._program(is_orthographic)
            self._arrays[is_orthographic] = self._device.gl.vertex_array(
                program, [(vertices, "3f", "position")], index_buffer=triangles, index_element_size=4
            )
        return self._arrays[is_orthographic]


def _clip_from_world(frame: Frame) -> NDArray[np.float64]:
    """Return OpenGL's projection: v = 0 is the first row of the texture, and depth 0 … 1 is z = -w … w.

    In a perspective frame z is OpenGL's usual one, not linear but clipped at the same planes.
    """
    rows = frame.projection
    clip = 2.0 * rows - rows[3]
    clip[3] = rows[3]
    if frame.near is not None:
        near, far = frame.near, frame.near + frame.depth_range
        clip[2] = (far + near) / (far - near) * rows[3]
        clip[2, 3] -= 2.0 * far * near / (far - near)
    return clip


def _column_major(matrix: NDArray[np.float64]) -> bytes:
    return matrix.T.astype(np.float32).tobytes()
