"""Receivers in light space: which of them are asked for, in which of the light's windows, and where in it.

:class:`LightSamples` finds the window of every point that needs asking (one, or six around a point light) and decides
those that need no triangle: turned away from the light, outside a spot light's cone. What is built over the samples
(:mod:`shadowbench.device.irregular_strips`, :mod:`shadowbench.device.irregular_bsp`) keeps their coordinates, which
:func:`lay_down` makes. Together, this is what the alias-free paper calls *transformation of samples*.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from shadowbench.device.arrays import as_warp
from shadowbench.device.launch import Context, launch
from shadowbench.device.light_samples_kernels import (
    BLOCK,
    Field,
    place_points,
    place_receivers,
    place_receivers_in_sun,
    transform_samples,
)
from shadowbench.device.sample_space import SampleSpace, sample_spaces
from shadowbench.device.visibility import light_point, plane_tolerance
from shadowbench.light_space import axes_of
from shadowbench.receivers import Receivers
from shadowbench.scene import DirectionalLight, Light, PointLight, SpotLight
from shadowbench.world import World


@dataclass(frozen=True, eq=False)
class WindowSamples:
    """The samples of one window.

    Attributes:
        space: The window's light space.
        number: The window's number.
        window: Number of every point's window, or what says that it has none, uint8, shape [point_count].
        position: Every point, wp.vec3, shape [point_count].
        first_sample: Samples before each block of ``BLOCK`` points, int32, shape [block_count + 1].
    """

    space: SampleSpace
    number: int
    window: wp.array[Any]
    position: wp.array[Any]
    first_sample: NDArray[np.int32]

    @property
    def count(self) -> int:
        return int(self.first_sample[-1])

    @property
    def block_count(self) -> int:
        return len(self.first_sample) - 1


class LightSamples:
    """Points placed in a light's windows; memory is kept between frames.

    Args:
        context: Where to run.
    """

    def __init__(self, context: Context) -> None:
        self.context = context
        self._capacity = -1

    @property
    def kept_bytes(self) -> int:
        """Memory that stays alive between frames [bytes]."""
        return 0 if self._capacity < 0 else int(self._window.capacity)

    def place_receivers(
        self, receivers: Receivers, light: Light, world: World, visibility: wp.array[Any]
    ) -> list[WindowSamples]:
        """Place receivers.

        Args:
            receivers: The visible samples.
            light: Directional, spot or point.
            world: What the receivers are made of.
            visibility: Set to 0, or to 1 for points in the light's very place, which nothing can shadow; float32, shape
                [receiver_count] or [receiver_count, channels].

        Returns:
            The samples of each window, views of memory that the next call overwrites.

        Raises:
            SceneError: An area light.
        """
        on_device = receivers.on(self.context.device)
        inputs = [
            wp.vec3d(*receivers.eye),
            plane_tolerance(world.scale),
            world.lookup(self.context.device),
            on_device.valid,
            on_device.position,
            on_device.normal,
            on_device.triangle,
        ]
        if isinstance(light, DirectionalLight):
            return self._place(place_receivers_in_sun, inputs, on_device.position, light, world.scale, visibility)
        inputs = [_field_of(light), *inputs]
        return self._place(place_receivers, inputs, on_device.position, light, world.scale, visibility)

    def place_points(
        self, position: wp.array[Any], light: Light, scale: float, visibility: wp.array[Any]
    ) -> list[WindowSamples]:
        """Place arbitrary points, whose own planes nobody asks about; see :meth:`place_receivers`.

        Args:
            position: World positions, wp.vec3, shape [n].
            light: Directional, spot or point.
            scale: The scene's largest absolute coordinate.
            visibility: As there.
        """
        return self._place(place_points, [_field_of(light), position], position, light, scale, visibility)

    def _place(
        self,
        place: wp.Kernel,
        inputs: list[Any],
        position: wp.array[Any],
        light: Light,
        scale: float,
        visibility: wp.array[Any],
    ) -> list[WindowSamples]:
        device, count = self.context.device, int(position.shape[0])
        if count > self._capacity:
            self._capacity = count
            self._window = wp.empty(count, dtype=wp.uint8, device=device)
        windows = _window_count(light)
        blocks = -(-count // int(BLOCK))
        sample_count = wp.zeros((blocks, windows), dtype=wp.int32, device=device)
        low, high = (wp.empty(blocks, dtype=wp.vec3, device=device) for _ in range(2))
        visibility.zero_()
        outputs = [self._window, sample_count, low, high]
        if not isinstance(light, DirectionalLight) or place is place_points:
            outputs.append(visibility.reshape((count, -1)))  # for points in a positional light's very place
        launch(
            place,
            blocks,
            inputs=[light_point(light), *inputs],
            outputs=outputs,
            context=self.context,
            block_size=1,
        )
        before = np.zeros((blocks + 1, windows), np.int32)
        np.cumsum(sample_count.numpy(), axis=0, out=before[1:])
        if not before[-1].any():
            return []
        spaces = sample_spaces(light, scale, low.numpy().min(axis=0), high.numpy().max(axis=0))
        return [
            WindowSamples(space, w, self._window, position, before[:, w])
            for w, space in enumerate(spaces)
            if before[-1, w] > 0
        ]


def lay_down(samples: WindowSamples, records: wp.array[Any], context: Context) -> None:
    """Transform the samples of a window, in the order of the points.

    Args:
        samples: The window's.
        records: Becomes (x, y, depth, number of the point as bits), wp.vec4, shape [sample_count] at least.
        context: Where to run.
    """
    launch(
        transform_samples,
        samples.block_count,
        inputs=[
            samples.space,
            samples.number,
            samples.window,
            samples.position,
            as_warp(np.ascontiguousarray(samples.first_sample), wp.int32, context.device),
        ],
        outputs=[records],
        context=context,
        block_size=1,
    )


def _window_count(light: Light) -> int:
    return 6 if isinstance(light, PointLight) else 1


def _field_of(light: Light) -> Any:
    """A light's :class:`Field`."""
    field: Any = Field()  # its members are Warp's types to a checker, Python's numbers to us
    field.window_count = _window_count(light)
    field.squared_cosine = -1.0
    if isinstance(light, SpotLight):
        cosine = math.cos(math.radians(light.angle) / 2.0)
        field.axis = wp.vec3d(*axes_of(light.direction)[2])
        field.squared_cosine = cosine * cosine
    return field


def exclusive_sums(counts: NDArray[np.int32]) -> NDArray[Any]:
    """Return where each block's share of each column begins if columns follow each other and blocks within them.

    Args:
        counts: Shape [block_count, column_count].

    Returns:
        int32, shape [block_count + 1, column_count]; the last row holds the columns' ends.
    """
    blocks, columns = counts.shape
    ends = np.zeros(blocks * columns + 1, np.int64)
    np.cumsum(counts.T.reshape(-1), out=ends[1:])
    begins = np.empty((blocks + 1, columns), np.int32)
    begins[:blocks] = ends[:-1].reshape(columns, blocks).T
    begins[blocks] = ends[blocks::blocks]
    return begins
