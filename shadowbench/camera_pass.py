"""The camera pass: which surface points every pixel sees.

Rasterises the world from the camera with triangle numbers, then turns every covered pixel into a receiver
(:mod:`shadowbench.device.surface_points`). It is the part of a frame that all techniques share; the harness times it
in the same rounds as the techniques.

A pixel may have several samples, each a receiver with its share of the pixel, and a sample several layers where it
sees through translucent surfaces (:mod:`shadowbench.device.picture_samples`). A surface's opacity is 1 less the mean of
its transmittance. A sample's last layer is taken for opaque, whatever it is made of: with one layer, the nearest
surface hides everything behind it.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from shadowbench.device.arrays import as_warp
from shadowbench.device.depth_rasterizer import DepthRasterizer
from shadowbench.device.launch import Context, launch, synchronize
from shadowbench.device.picture_samples import PictureSamples
from shadowbench.device.surface_points import PixelRays, find_sample_points, find_surface_points
from shadowbench.errors import SceneError
from shadowbench.light_space import Frame, camera_frame
from shadowbench.receivers import Receivers
from shadowbench.scene import Camera, Instance
from shadowbench.world import World

_FIELDS: dict[str, Any] = {
    "position": wp.vec3,
    "normal": wp.vec3,
    "instance": wp.int32,
    "triangle": wp.int32,
    "position_dx": wp.vec3,
    "position_dy": wp.vec3,
    "valid": wp.uint8,
}


class CameraPass:
    """The camera pass of one world, camera and picture size; every run reuses the same memory.

    Args:
        world: The placed scene.
        camera: One of its cameras.
        width, height: Picture size [pixels].
        context: Where to run.
        samples: Of every pixel; 1 is the pixel's centre, more are spread over it.
        layers: Most surfaces that a sample sees, one behind the other.

    Raises:
        ValueError: ``samples`` or ``layers`` is not positive.
    """

    def __init__(
        self,
        world: World,
        camera: Camera,
        width: int,
        height: int,
        context: Context,
        *,
        samples: int = 1,
        layers: int = 1,
    ) -> None:
        if samples < 1 or layers < 1:
            raise ValueError(f"a pixel has at least 1 sample and 1 layer, not {samples} and {layers}")
        self.world, self.camera, self.context = world, camera, context
        self.width, self.height = width, height
        self.samples, self.layers = samples, layers
        self.frame = camera_frame(camera, width, height, world)
        self._rays = _pixel_rays(self.frame, camera, width, height)
        receives = np.array([i.receives for i in world.instances], dtype=np.uint8)
        self._receives = as_warp(receives, wp.uint8, context.device)
        pixel_count = width * height
        self._capacity = 0
        self._reserve(pixel_count)
        self._first_of_pixel = np.zeros(pixel_count + 1, dtype=np.int32)
        if samples == layers == 1:
            self._rasterizer = DepthRasterizer(width, height, context, keep_ids=True)
            self._layer = np.zeros(pixel_count, dtype=np.int32)
            self._one = np.ones(pixel_count, dtype=np.float32)  # weight and alpha
        else:
            self._picture_samples = PictureSamples(width, height, samples, layers, context)
            self._opacity = np.array([_opacity(i) for i in world.instances], dtype=np.float32)

    def run(self) -> Receivers:
        """Render.

        Returns:
            One receiver per pixel, sample and layer that sees a surface. On the CPU its arrays are views of this
            object's memory, which the next run overwrites.

        Raises:
            SceneError: The camera sees nothing.
        """
        if self.samples == self.layers == 1:
            return self._centres()
        return self._sampled()

    def _centres(self) -> Receivers:
        """Render with one receiver per pixel at most, at its centre."""
        frame = self.frame
        self._rasterizer.clear()
        for batch in self.world.batches(self.context):
            self._rasterizer.draw(
                batch.vertices,
                batch.triangles,
                frame.projection,
                near=frame.near,
                first_triangle=batch.first_triangle,
            )
        assert self._rasterizer.ids is not None
        seen = self._rasterizer.ids.reshape((self.width * self.height,))
        covered = seen.numpy() >= 0
        pixel = np.flatnonzero(covered).astype(np.int32)
        self._find(find_surface_points, pixel, [as_warp(pixel, wp.int32, self.context.device), seen])
        np.cumsum(covered, out=self._first_of_pixel[1:])
        count = len(pixel)
        return self._receivers(pixel, self._layer[:count], weight=self._one[:count], alpha=self._one[:count])

    def _sampled(self) -> Receivers:
        """Render with a receiver for every sample's every layer."""
        device = self.context.device
        seen = self._picture_samples.find(self.world, self.frame)
        count = len(seen.pixel)
        self._reserve(count)
        of_receiver = [as_warp(a, wp.int32, device) for a in (seen.pixel, seen.sample, seen.triangle)]
        pattern = as_warp(self._picture_samples.pattern, wp.vec2d, device)
        self._find(find_sample_points, seen.pixel, [*of_receiver, pattern])
        np.cumsum(np.bincount(seen.pixel, minlength=self.width * self.height), out=self._first_of_pixel[1:])
        weight = np.full(count, 1.0 / self.samples, dtype=np.float32)
        alpha = self._opacity[self._buffers["instance"].numpy()[:count]]
        alpha[seen.layer == self.layers - 1] = 1.0
        return self._receivers(seen.pixel, seen.layer, weight=weight, alpha=alpha)

    def _find(self, kernel: wp.Kernel, pixel: NDArray[np.int32], seen: list[wp.array[Any]]) -> None:
        """Compute the receivers' points; ``seen`` is what the kernel asks for first."""
        if len(pixel) == 0:
            raise SceneError("the camera sees no surface; move it or point it at the scene")
        launch(
            kernel,
            len(pixel),
            inputs=[*seen, self._rays, self.world.lookup(self.context.device), self._receives],
            outputs=[self._buffers[name] for name in _FIELDS],
            context=self.context,
        )
        synchronize(self.context)

    def _reserve(self, count: int) -> None:
        """Make room for receivers."""
        if count > self._capacity:
            self._capacity = count
            self._buffers: dict[str, wp.array[Any]] = {
                name: wp.empty(count, dtype=dtype, device=self.context.device) for name, dtype in _FIELDS.items()
            }

    def _receivers(
        self,
        pixel: NDArray[np.int32],
        layer: NDArray[np.int32],
        *,
        weight: NDArray[np.float32],
        alpha: NDArray[np.float32],
    ) -> Receivers:
        arrays = {name: buffer.numpy()[: len(pixel)] for name, buffer in self._buffers.items()}
        return Receivers(
            width=self.width,
            height=self.height,
            eye=self.camera.eye,
            pixel=pixel,
            layer=layer,
            weight=weight,
            alpha=alpha,
            position=arrays["position"],
            normal=arrays["normal"],
            instance=arrays["instance"],
            triangle=arrays["triangle"],
            position_dx=arrays["position_dx"],
            position_dy=arrays["position_dy"],
            valid=arrays["valid"].view(np.bool_),
            first_of_pixel=self._first_of_pixel,
        )


def render(
    world: World, camera: Camera, width: int, height: int, context: Context, *, samples: int = 1, layers: int = 1
) -> Receivers:
    """Return what ``camera`` sees of ``world``; see :class:`CameraPass`."""
    return CameraPass(world, camera, width, height, context, samples=samples, layers=layers).run()


def _opacity(instance: Instance) -> float:
    red, green, blue = instance.transmittance
    return 1.0 - (red + green + blue) / 3.0


def _pixel_rays(frame: Frame, camera: Camera, width: int, height: int) -> PixelRays:
    right, down, forward = frame.axes
    half_width, half_height = frame.extent[0] / 2.0, frame.extent[1] / 2.0
    rays = PixelRays()
    rays.eye = wp.vec3d(*camera.eye)
    rays.corner = wp.vec3d(*(forward - half_width * right - half_height * down))
    rays.per_column = wp.vec3d(*(frame.extent[0] / width * right))
    rays.per_row = wp.vec3d(*(frame.extent[1] / height * down))
    rays.width = wp.int32(width)
    return rays
