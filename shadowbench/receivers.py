"""The visible samples of a picture, whose shadows are asked for.

:class:`Receivers` is a flat list sorted by pixel, not an image: pictures with one sample a pixel, supersampled ones
(``weight``) and semi-transparent surfaces (``layer``, ``alpha``) are the same thing to a method.
:func:`shadowbench.camera_pass.render` makes them; every array is NumPy and, on the CPU, shares its memory with the
Warp array that :meth:`Receivers.on` returns.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from shadowbench.per_device import once_per_device
from shadowbench.scene import Vector

if TYPE_CHECKING:
    import warp as wp


@dataclass(frozen=True, eq=False)
class Receivers:
    """Visible samples, sorted by pixel, then by sample, then by layer (nearest first).

    Attributes:
        width, height: Size of the picture [pixels].
        eye: The camera's position in the recentred world.
        pixel: ``row * width + column``, int32, shape [n].
        layer: 0 for the nearest surface of the sample, int32, shape [n].
        weight: Share of the pixel; a pixel's samples sum to 1; float32, shape [n].
        alpha: Opacity of the surface, float32, shape [n].
        position: The surface point, world space, on its triangle to within rounding, float32, shape [n, 3].
        normal: Unit geometric normal, turned towards the camera, float32, shape [n, 3].
        instance: Index into the world's instances, int32, shape [n].
        triangle: Index into the world's triangles (all instances, see :class:`shadowbench.world.World`), int32, [n].
        position_dx, position_dy: How the point moves in the triangle's plane for one pixel to the right, one pixel
            down [scene units per pixel], float32, shape [n, 3].
        valid: Whether a method must write this receiver (its instance receives shadows), bool, shape [n].
        first_of_pixel: Receivers of pixel ``p`` are ``first_of_pixel[p] .. first_of_pixel[p + 1]``, int32,
            shape [width * height + 1].
    """

    width: int
    height: int
    eye: Vector
    pixel: NDArray[np.int32]
    layer: NDArray[np.int32]
    weight: NDArray[np.float32]
    alpha: NDArray[np.float32]
    position: NDArray[np.float32]
    normal: NDArray[np.float32]
    instance: NDArray[np.int32]
    triangle: NDArray[np.int32]
    position_dx: NDArray[np.float32]
    position_dy: NDArray[np.float32]
    valid: NDArray[np.bool_]
    first_of_pixel: NDArray[np.int32]

    def __len__(self) -> int:
        return len(self.pixel)

    @property
    def count(self) -> int:
        """Number of receivers."""
        return len(self.pixel)

    def only(self, index: int) -> Receivers:
        """Return one receiver alone, as number 0, in the same picture."""
        chosen: dict[str, Any] = {
            name: np.ascontiguousarray(getattr(self, name)[index : index + 1])
            for name in (
                *("pixel", "layer", "weight", "alpha", "position", "normal", "instance", "triangle"),
                *("position_dx", "position_dy", "valid"),
            )
        }
        first_of_pixel = np.zeros_like(self.first_of_pixel)
        first_of_pixel[self.pixel[index] + 1 :] = 1
        return replace(self, **chosen, first_of_pixel=first_of_pixel)

    def on(self, device: str) -> DeviceReceivers:
        """Return the arrays that kernels read, as Warp arrays (zero-copy on the CPU)."""
        return _device_receivers(self, device)

    def picture(self, values: NDArray[Any], *, background: float = 0.0) -> NDArray[np.float64]:
        """Return per-receiver values composited into an image.

        Args:
            values: Shape [n] or [n, channels].
            background: Value where no receiver is.

        Returns:
            Shape [height, width] or [height, width, channels]: within a sample front to back by ``alpha``, over a
            pixel's samples by ``weight``.
        """
        flat = values.reshape(len(self), -1).astype(np.float64)
        coverage = self.coverage()[:, None]
        image = np.empty((self.width * self.height, flat.shape[1]))
        for channel in range(flat.shape[1]):
            image[:, channel] = np.bincount(
                self.pixel, coverage[:, 0] * flat[:, channel], minlength=self.width * self.height
            )
        covered = np.bincount(self.pixel, coverage[:, 0], minlength=self.width * self.height)
        image += (1.0 - covered)[:, None] * background
        return image.reshape(self.height, self.width, *values.shape[1:])

    def coverage(self) -> NDArray[np.float64]:
        """Return each receiver's share in its pixel: weight, alpha and what the layers before it let through."""
        share = self.weight.astype(np.float64) * self.alpha
        if not self.layer.any():
            return share
        through = np.ones(len(self))
        for layer in range(1, int(self.layer.max()) + 1):
            index = np.flatnonzero(self.layer == layer)
            through[index] = through[index - 1] * (1.0 - self.alpha[index - 1])
        return share * through


@dataclass(frozen=True, eq=False)
class DeviceReceivers:
    """Receivers on a device; each attribute as in :class:`Receivers`, vectors as wp.vec3, ``valid`` as wp.uint8."""

    position: wp.array[Any]
    normal: wp.array[Any]
    triangle: wp.array[Any]
    instance: wp.array[Any]
    position_dx: wp.array[Any]
    position_dy: wp.array[Any]
    valid: wp.array[Any]

    @property
    def count(self) -> int:
        return int(self.position.shape[0])


@once_per_device
def _device_receivers(receivers: Receivers, device: str) -> DeviceReceivers:
    import warp as wp  # lazily: pictures and measures are made without Warp

    from shadowbench.device.arrays import as_warp

    return DeviceReceivers(
        position=as_warp(receivers.position, wp.vec3, device),
        normal=as_warp(receivers.normal, wp.vec3, device),
        triangle=as_warp(receivers.triangle, wp.int32, device),
        instance=as_warp(receivers.instance, wp.int32, device),
        position_dx=as_warp(receivers.position_dx, wp.vec3, device),
        position_dy=as_warp(receivers.position_dy, wp.vec3, device),
        valid=as_warp(receivers.valid.view(np.uint8), wp.uint8, device),
    )
