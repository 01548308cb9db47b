"""What all methods of the peer have in common: when they apply, the device they draw on, and the order of the work."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from importlib.metadata import version
from typing import TYPE_CHECKING, Any, ClassVar

from shadowbench.light_space import Frame, light_frames
from shadowbench.method import Changes, Context, Method, Trace, View
from shadowbench.parameters import ParameterModel, parameter
from shadowbench.receivers import Receivers
from shadowbench.scene import Light, RectangularLight
from shadowbench.world import Casters, World

from .device import OpenglDevice
from .drawing import NOTHING, CasterDrawing, Color
from .look_up import LookUp, ReceiverTextures
from .probe import probe

if TYPE_CHECKING:
    import moderngl
    import warp as wp

OPENGL_COUNTERS = {
    "triangles drawn": "casters' triangles times the number of maps",
    "map texels": "texels over all maps, without their mip chains",
    "look-ups": "valid receivers",
}


class OpenglParameters(ParameterModel):
    resolution: int = parameter(1024, unit="texels", help="Width and height of each map.", ge=1, le=16384)
    bias: float = parameter(1.0e-5, unit="depth", help="Constant bias, taken off the receiver's depth.", ge=0.0, le=1.0)


class OpenglMethod(Method):
    """A shadow technique drawn by OpenGL.

    A subclass makes its maps when the number of faces is known, says what drawing stores, what happens to the maps
    afterwards, and how a receiver is looked up.
    """

    counters: ClassVar[dict[str, str]] = OPENGL_COUNTERS
    has_gradients: bool = False
    """Whether the look-up needs to know how receivers change from pixel to pixel."""

    parameters: OpenglParameters
    _light: Light
    _frames: Sequence[Frame]

    def __init__(self, parameters: OpenglParameters, context: Context) -> None:
        super().__init__(parameters, context)
        self._device: OpenglDevice | None = None

    @classmethod
    def available(cls) -> str | None:
        return probe().reason or None

    @classmethod
    def library_versions(cls) -> dict[str, str]:
        found = probe()
        return {"moderngl": version("moderngl"), "OpenGL renderer": found.renderer, "OpenGL": found.version}

    def supports(self, world: World, light: Light) -> str | None:
        if isinstance(light, RectangularLight):
            return "an area light has no depth map"
        if not world.casters.is_opaque:
            return "a depth map holds opaque casters only"
        largest = probe().largest_texture
        if self.parameters.resolution > largest:
            return f"a texture has at most {largest}² texels here, not {self.parameters.resolution}²"
        return None

    @abstractmethod
    def make_drawing(self, device: OpenglDevice) -> CasterDrawing:
        """Return what draws the casters."""

    @abstractmethod
    def make_maps(self, device: OpenglDevice, faces: int) -> None:
        """Allocate the maps."""

    @abstractmethod
    def targets(self) -> Sequence[moderngl.Framebuffer]:
        """Return what to draw into, one a face."""

    @abstractmethod
    def make_look_up(self, device: OpenglDevice, receivers: ReceiverTextures, faces: int) -> LookUp:
        """Return the look-up."""

    @abstractmethod
    def sampled(self) -> tuple[Sequence[moderngl.Texture], moderngl.Sampler]:
        """Return the maps to look up in, one a face, and how to sample them."""

    def empty(self) -> Color:
        """Return what is stored beside depth where nothing casts."""
        return NOTHING

    def filter_maps(self, device: OpenglDevice, trace: Trace) -> None:
        """Prepare the drawn maps for the look-up."""

    def bytes_of_maps(self) -> dict[str, int]:
        """Return the bytes of the maps, by name."""
        return {}

    def build(self, casters: Casters, light: Light, view: View, changes: Changes, trace: Trace) -> None:
        self._light, self._frames = light, light_frames(light, casters.world)
        device = self._device
        if device is None:
            device = self._device = OpenglDevice(self.context)
            with device:
                self._make(device, len(self._frames))
        with device:
            if changes.instances or casters.triangle_count != self._drawing.triangle_count:
                with device.stage(trace, "caster upload"):
                    self._drawing.upload(casters)
            with device.stage(trace, "depth map"):
                for frame, target in zip(self._frames, self.targets(), strict=True):
                    self._drawing.draw(frame, target, empty=self.empty())
            self.filter_maps(device, trace)
        trace.count("triangles drawn", casters.triangle_count * len(self._frames))
        trace.count("map texels", self.parameters.resolution**2 * len(self._frames))
        for name, byte_count in self.bytes_of_maps().items():
            trace.keep_bytes(name, byte_count)
        trace.keep_bytes("casters on the device", self._drawing.byte_count)

    def _make(self, device: OpenglDevice, faces: int) -> None:
        self._drawing = self.make_drawing(device)
        self.make_maps(device, faces)
        self._receivers = ReceiverTextures(device, has_gradients=self.has_gradients, largest=probe().largest_texture)
        self._look_up = self.make_look_up(device, self._receivers, faces)

    def shade(self, receivers: Receivers, visibility: wp.array[Any], trace: Trace) -> None:
        assert self._device is not None
        with self._device as device:
            with device.stage(trace, "receiver upload"):
                self._receivers.upload(receivers)
            with device.stage(trace, "look-up"):
                self._look_up.run(self._light, self._frames, *self.sampled())
            with device.stage(trace, "read-back"):
                self._receivers.read(visibility.numpy())
        trace.count("look-ups", int(receivers.valid.sum()))
        trace.keep_bytes("receivers on the device", self._receivers.byte_count)

    def close(self) -> None:
        if self._device is not None:
            self._device.close()
            self._device = None
