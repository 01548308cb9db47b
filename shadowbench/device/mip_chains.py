"""Mip chains: a map and all its halvings down to one texel, in one array.

Each face of a map is square. Level 0 has its full size; a level of n texels along each axis is followed by one of n/2,
rounded down, and the last has a single texel: 1 + log2(size) levels, rounded down, and for 2048 x 2048 texels 5,592,405
in all. Where n is even a texel stands for the 2 x 2 under it; where n is odd for 3 x 3, each weighted by the area that
it shares with the coarser texel, so that every level has the mean of the first. Faces of a cube are halved each by
itself. Results do not depend on the number of threads. The bodies are native
(:mod:`shadowbench.device.mip_chains_kernels`), so that this runs on the CPU only.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import warp as wp

from shadowbench.device.launch import Context, launch
from shadowbench.device.mip_chains_kernels import (
    chain_layout,
    fill_with_byte_means,
    fill_with_logarithms,
    fill_with_maxima,
    fill_with_means,
)
from shadowbench.device.separable_filters_kernels import MOST_CHANNELS

MOST_VALUES = 2**31 - 1
"""Most values in a chain: indices are 32-bit."""

_STRIPS_PER_THREAD = 8
_SMALL_LEVEL = 1 << 15
"""Levels of at most so many values are filled together, one thread a face: starting threads costs more."""


def level_sizes(size: int) -> tuple[int, ...]:
    """Return the texels along an axis of each level, from ``size`` down to 1."""
    sizes = [size]
    while sizes[-1] > 1:
        sizes.append(sizes[-1] // 2)
    return tuple(sizes)


def chain_texels(size: int, *, has_levels: bool = True) -> int:
    """Return the number of texels of a face: of all levels, or of level 0 alone."""
    return sum(s * s for s in (level_sizes(size) if has_levels else (size,)))


class MipChain:
    """The levels of a map.

    Args:
        face_count: 1, or 6 around a point light.
        size: Texels along each axis of level 0.
        context: Where to run.
        channels: Values a texel.
        dtype: ``wp.float32`` or ``wp.uint8``.
        has_levels: ``False`` for level 0 alone.

    Attributes:
        values: Level after level, in each face after face, row after row; shape [value_count].
        layout: Where the levels begin, for kernels.

    Raises:
        ValueError: The chain has more values or channels than there may be.
    """

    def __init__(
        self,
        face_count: int,
        size: int,
        context: Context,
        *,
        channels: int = 1,
        dtype: Any = wp.float32,
        has_levels: bool = True,
    ) -> None:
        self._sizes = level_sizes(size) if has_levels else (size,)
        counts = [face_count * s * s * channels for s in self._sizes]
        if sum(counts) > MOST_VALUES or not 1 <= channels <= MOST_CHANNELS:
            raise ValueError(
                f"a chain of {sum(counts):,} values with {channels} channels; "
                f"at most {MOST_VALUES:,} and {MOST_CHANNELS} are possible"
            )
        self.values: wp.array[Any] = wp.empty(sum(counts), dtype=dtype, device=context.device)
        self._first = np.concatenate([[0], np.cumsum(counts)])
        self._face_count, self._context = face_count, context
        self._channels = channels
        self.layout = chain_layout(self._first[:-1], size, channels, context.device)

    @property
    def level_count(self) -> int:
        return len(self._sizes)

    @property
    def texel_count(self) -> int:
        """Texels of all levels and faces."""
        return int(self._first[-1]) // self._channels

    def level(self, number: int) -> wp.array[Any]:
        """Return a view of a level, shape [face, row, column, channel]."""
        size = self._sizes[number]
        part = self.values[int(self._first[number]) : int(self._first[number + 1])]
        return part.reshape((self._face_count, size, size, self._channels))

    def fill_with_means(self) -> None:
        """Make every level the mean of the one before; 8-bit values are rounded half up at each level."""
        self._fill(fill_with_byte_means if self.values.dtype == wp.uint8 else fill_with_means, 1.0)

    def fill_with_maxima(self) -> None:
        """Make every level the largest of the one before; float32."""
        self._fill(fill_with_maxima, 1.0)

    def fill_with_logarithmic_means(self, steepness: float) -> None:
        """Make every level ln(mean of e^(c z)) / c of the one before, which holds z; c is ``steepness``; float32."""
        self._fill(fill_with_logarithms, steepness)

    def _fill(self, kernel: wp.Kernel, steepness: float) -> None:
        level = 0
        while level + 1 < self.level_count:
            end, strips = self._levels_together(level)
            launch(
                kernel,
                self._face_count * strips,
                inputs=[self.layout, level, end, strips, steepness],
                outputs=[self.values],
                context=self._context,
                block_size=1,
            )
            level = end

    def _levels_together(self, level: int) -> tuple[int, int]:
        """Return up to which level one launch can go on from ``level``, and in how many strips a face.

        Strips that are halved evenly stay among themselves, and in the cache, from level to level.
        """
        if self._first[level + 1] - self._first[level] <= _SMALL_LEVEL:
            return self.level_count - 1, 1
        strips = 2 * _STRIPS_PER_THREAD
        while strips < _STRIPS_PER_THREAD * self._context.threads:
            strips *= 2
        end = level + 1
        while end + 1 < self.level_count and self._sizes[end] % (2 * strips) == 0:
            end += 1
        return end, strips
