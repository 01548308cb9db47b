"""Drawing casters into a light's maps.

The vertex shader computes the linear depth beside the position. Where the frame is orthographic the rasteriser
interpolates the same depth, and what is stored leaves the early depth test alone; where it is a perspective one the
fragment shader writes it. Polygon offset is OpenGL's own in the first case and its formula in the second.
"""

from __future__ import annotations

from collections.abc import Iterator
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

    Where the scene keeps flat arrays they are uploaded once. Otherwise batches of placed instances pass through one
    pair of buffers at every draw, so that their float32 positions are the world's own and need no room for all.

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
        self._casters: Casters | None = None

    @property
    def triangle_count(self) -> int:
        """Number of triangles drawn."""
        return self._casters.triangle_count if self._casters is not None else 0

    @property
    def byte_count(self) -> int:
        """Bytes of the triangles on the device."""
        return sum(buffer.size for buffer in self._buffers)

    def upload(self, casters: Casters) -> None:
        """Replace the triangles."""
        self._casters = casters
        if casters.is_flat:
            self._put(casters.vertices, casters.triangles)
        else:
            self._put(np.zeros((0, 3), np.float32), np.zeros((0, 3), np.int32))

    def _put(self, vertices: NDArray[np.float32], triangles: NDArray[np.int32]) -> None:
        """Have these triangles on the device and no others."""
        for array in self._arrays.values():
            array.release()
        for buffer in self._buffers:
            buffer.release()
        self._arrays.clear()
        self._buffers = []
        if len(triangles):
            geometry = (vertices, triangles)
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
        if not self.triangle_count:
            return
        program = self._program(frame.is_orthographic)
        program["clip_from_world"].write(_column_major(_clip_from_world(frame)))  # type: ignore[union-attr]
        if "depth_from_world" in program:
            program["depth_from_world"].write(frame.projection[2].astype(np.float32).tobytes())  # type: ignore[union-attr]
        gl.enable_only(gl.DEPTH_TEST)
        gl.polygon_offset = (self._slope_bias, 0.0) if frame.is_orthographic else (0.0, 0.0)
        for _ in self._filled_buffers():
            self._array(frame.is_orthographic).render(gl.TRIANGLES)

    def _filled_buffers(self) -> Iterator[None]:
        """Stop wherever the buffers hold triangles to draw, until all have been there."""
        assert self._casters is not None
        if self._casters.is_flat:
            yield
        else:
            for batch in self._casters.batches(self._device.context):
                self._put(batch.vertices.numpy(), batch.triangles.numpy().reshape(-1, 3))
                yield

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
