"""Many depth maps of different sizes in one array, each kept until it is wanted no more."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from typing import Any

import warp as wp

from shadowbench.device.launch import Context


class MapPool:
    """Square depth maps by key.

    Args:
        context: Where to run.

    Attributes:
        device: Where they are.
        depth: All maps one after the other, float32, shape [texel_count].
        first_texel: Where each map begins, by key.
        resolution: Its width and height [texels].
    """

    def __init__(self, context: Context) -> None:
        self.device = context.device
        self.depth: wp.array[Any] = wp.empty(0, dtype=wp.float32, device=self.device)
        self.first_texel: dict[Hashable, int] = {}
        self.resolution: dict[Hashable, int] = {}

    def arrange(self, resolutions: Mapping[Any, int]) -> set[Hashable]:
        """Keep these maps and no others.

        Args:
            resolutions: Width and height of each map [texels].

        Returns:
            Keys of the maps that hold nothing yet: all that were not here before at the same resolution.
        """
        fresh = {key for key, resolution in resolutions.items() if self.resolution.get(key) != resolution}
        if fresh or len(resolutions) != len(self.resolution):
            self._rearrange(resolutions, fresh)
        return fresh

    def map(self, key: Hashable) -> wp.array[Any]:
        """Return one map, float32, shape [resolution, resolution], sharing the pool's memory."""
        first, resolution = self.first_texel[key], self.resolution[key]
        texels = self.depth[first : first + resolution * resolution]
        return texels.reshape((resolution, resolution))

    def _rearrange(self, resolutions: Mapping[Any, int], fresh: set[Hashable]) -> None:
        kept = {key: self.map(key).flatten() for key in resolutions if key not in fresh}
        texel_count = sum(resolution * resolution for resolution in resolutions.values())
        # where nothing is carried over, memory of the right size can stay
        depth = self.depth
        if kept or texel_count != depth.size:
            depth = wp.empty(texel_count, dtype=wp.float32, device=self.device)
        self.resolution, self.first_texel = dict(resolutions), {}
        first = 0
        for key, resolution in resolutions.items():
            self.first_texel[key] = first
            if key in kept:
                wp.copy(depth, kept[key], dest_offset=first)
            first += resolution * resolution
        self.depth = depth
