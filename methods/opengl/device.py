"""An OpenGL device without a window: its context, its threads, and the pass that covers a texture.

Made at the first use, never by looking at a method, since a driver may end the process. A context is current only
inside ``with device:``, so that several methods can live in one process.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from types import TracebackType
from typing import TYPE_CHECKING, Any, Self

from shadowbench.device.processors import confined_to
from shadowbench.method import Context, Trace

if TYPE_CHECKING:
    import moderngl

COVERING = """
#version 330
void main() {  // one triangle that covers the window
    gl_Position = vec4(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0, 0.0, 1.0);
}
"""

_LLVMPIPE_SHORTCUTS_OFF = "no_quad_lod"


class OpenglDevice:
    """A context of OpenGL 3.3 or newer.

    Args:
        context: How many threads a software rasteriser may use.

    Attributes:
        context: As given.
    """

    def __init__(self, context: Context) -> None:
        import moderngl

        self.context = context
        self._threads = context.threads
        # llvmpipe draws on the calling thread if told to start none; its threads inherit the processors
        settings = {
            "LP_NUM_THREADS": str(context.threads if context.threads > 1 else 0),
            "GALLIVM_PERF": os.environ.get("GALLIVM_PERF", _LLVMPIPE_SHORTCUTS_OFF),
        }
        with _environment(settings), confined_to(context.threads):
            self.gl: moderngl.Context = moderngl.create_context(require=330, standalone=True, backend="egl")  # type: ignore[arg-type]
        self.nearest = self.gl.sampler(repeat_x=False, repeat_y=False, filter=(moderngl.NEAREST, moderngl.NEAREST))
        self.gl.mglo.__exit__()
        self._entered = ExitStack()

    def __enter__(self) -> Self:
        """Make the context current."""
        with ExitStack() as entered:
            if self._threads > 1:
                entered.enter_context(confined_to(self._threads))
            entered.enter_context(self.gl)
            self._entered = entered.pop_all()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        found = "GL_NO_ERROR" if kind is not None else self.gl.error
        self._entered.close()
        if found != "GL_NO_ERROR":
            raise RuntimeError(f"OpenGL reports {found}")

    @contextmanager
    def stage(self, trace: Trace, name: str) -> Iterator[None]:
        """Time a stage to the moment when the device has finished it."""
        with trace.stage(name):
            yield
            self.gl.finish()

    def program(self, vertex_shader: str, fragment_shader: str, **uniforms: Any) -> moderngl.Program:
        """Return a linked program with some uniforms set; those that the compiler removed are left out."""
        made = self.gl.program(vertex_shader=vertex_shader, fragment_shader=fragment_shader)
        for name, value in uniforms.items():
            if name in made:
                made[name] = value
        return made

    def covering_pass(self, fragment_shader: str, **uniforms: Any) -> CoveringPass:
        """Return a pass that runs a fragment shader once for each texel of a target."""
        return CoveringPass(self, self.program(COVERING, fragment_shader, **uniforms))

    def close(self) -> None:
        """Destroy the context and all that lives in it."""
        self.gl.release()


class CoveringPass:
    """A fragment shader that runs once for each texel of a target.

    Args:
        device: Where.
        program: Linked with :data:`COVERING`.
    """

    def __init__(self, device: OpenglDevice, program: moderngl.Program) -> None:
        self._device, self.program = device, program
        self._nothing = device.gl.vertex_array(program, [])

    def run(self, target: moderngl.Framebuffer, *sources: tuple[moderngl.Texture, moderngl.Sampler]) -> None:
        """Fill a target from textures; the first is bound to texture unit 0, and so on."""
        gl = self._device.gl
        gl.enable_only(gl.NOTHING)
        target.use()
        bind(sources)
        self._nothing.render(gl.TRIANGLES, vertices=3)


def bind(sources: Sequence[tuple[moderngl.Texture, moderngl.Sampler]]) -> None:
    """Bind textures and how to sample them to the texture units, in their order from 0."""
    for unit, (texture, sampler) in enumerate(sources):
        texture.use(unit)
        sampler.use(unit)


@contextmanager
def _environment(settings: dict[str, str]) -> Iterator[None]:
    """Set environment variables, for a library that reads them now."""
    before = {name: os.environ.get(name) for name in settings}
    os.environ.update(settings)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value
