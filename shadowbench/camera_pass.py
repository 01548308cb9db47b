"""The camera pass: which surface point every pixel sees.

Rasterises the world from the camera with triangle numbers, then turns every covered pixel into a receiver
(:mod:`shadowbench.device.surface_points`). It is the part of a frame that all techniques share; the harness times it
in the same rounds as the techniques.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from shadowbench.device.arrays import as_warp
from shadowbench.device.depth_rasterizer import DepthRasterizer
from shadowbench.device.launch import Context, launch, synchronize
from shadowbench.device.surface_points import PixelRays, find_surface_points
from shadowbench.errors import SceneError
from shadowbench.light_space import Frame, camera_frame
from shadowbench.receivers import Receivers
from shadowbench.scene import Camera
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
    """

    def __init__(self, world: World, camera: Camera, width: int, height: int, context: Context) -> None:
        self.world, self.camera, self.context = world, camera, context
        self.width, self.height = width, height
        self.frame = camera_frame(camera, width, height, world)
        self._rays = _pixel_rays(self.frame, camera, width, height)
        self._rasterizer = DepthRasterizer(width, height, context, keep_ids=True)
        self._first_triangle = as_warp(world.first_triangle, wp.int64, context.device)
        receives = np.array([i.receives for i in world.instances], dtype=np.uint8)
        self._receives = as_warp(receives, wp.uint8, context.device)
        pixel_count = width * height
        self._layer = np.zeros(pixel_count, dtype=np.int32)
        self._one = np.ones(pixel_count, dtype=np.float32)  # weight and alpha of opaque surfaces, one sample a pixel
        self._first_of_pixel = np.zeros(pixel_count + 1, dtype=np.int32)
        self._buffers = {
            name: wp.empty(pixel_count, dtype=dtype, device=context.device) for name, dtype in _FIELDS.items()
        }

    def run(self) -> Receivers:
        """Render.

        Returns:
            One receiver per pixel that sees a surface. On the CPU its arrays are views of this object's memory, which
            the next run overwrites.

        Raises:
            SceneError: The camera sees nothing.
        """
        geometry = self.world.on(self.context.device)
        self._rasterizer.clear()
        self._rasterizer.draw(geometry.vertices, geometry.triangles, self.frame.projection, near=self.frame.near)
        assert self._rasterizer.ids is not None
        seen = self._rasterizer.ids.reshape((self.width * self.height,))
        covered = seen.numpy() >= 0
        pixel = np.flatnonzero(covered).astype(np.int32)
        if len(pixel) == 0:
            raise SceneError("the camera sees no surface; move it or point it at the scene")
        launch(
            find_surface_points,
            len(pixel),
            inputs=[
                as_warp(pixel, wp.int32, self.context.device),
                seen,
                self._rays,
                geometry.vertices,
                geometry.triangles,
                self._first_triangle,
                self._receives,
            ],
            outputs=[self._buffers[name] for name in _FIELDS],
            context=self.context,
        )
        synchronize(self.context)
        return self._receivers(pixel, covered)

    def _receivers(self, pixel: NDArray[np.int32], covered: NDArray[np.bool_]) -> Receivers:
        count = len(pixel)
        arrays = {name: buffer.numpy()[:count] for name, buffer in self._buffers.items()}
        np.cumsum(covered, out=self._first_of_pixel[1:])
        return Receivers(
            width=self.width,
            height=self.height,
            eye=self.camera.eye,
            pixel=pixel,
            layer=self._layer[:count],
            weight=self._one[:count],
            alpha=self._one[:count],
            position=arrays["position"],
            normal=arrays["normal"],
            instance=arrays["instance"],
            triangle=arrays["triangle"],
            position_dx=arrays["position_dx"],
            position_dy=arrays["position_dy"],
            valid=arrays["valid"].view(np.bool_),
            first_of_pixel=self._first_of_pixel,
        )


def render(world: World, camera: Camera, width: int, height: int, context: Context) -> Receivers:
    """Return what ``camera`` sees of ``world``; see :meth:`CameraPass.run`."""
    return CameraPass(world, camera, width, height, context).run()


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
