"""Which triangles meet which region of the light's window: the lists that make rasterising parallel and local.

Irregular rasterisers cut a window's samples into regions (strips, subtrees) that threads own one at a time. Every
region gets the list of the triangles that may meet it, in file order whatever the number of threads: a counting sort
over fixed blocks of triangles. Lists hold copies of the corners: read in order they stream, where gathering them would
miss the cache at every triangle; and a region's samples stay in the cache while its list passes over them.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from shadowbench.device.arrays import as_warp
from shadowbench.device.blocker_batches import LANES
from shadowbench.device.launch import Context, kernel_options, launch
from shadowbench.device.light_samples import exclusive_sums
from shadowbench.device.placed_triangles import TriangleBatch
from shadowbench.world import Casters

wp.set_module_options(kernel_options(native=True))

TRIANGLE_BLOCK = wp.constant(1 << 14)
"""Triangles a kernel handles in a row; fixed, so that results never depend on the threads."""


@wp.struct
class BlockerLists:
    """Listed triangles by region.

    Attributes:
        corner: Their corners, shape [3 * listed_count] at least, and padding that batches read.
        number: Their numbers in the batch, shape [listed_count].
        first: Where each region's list begins, shape [region_count + 1].
    """

    corner: wp.array[wp.vec3]
    number: wp.array[wp.int32]
    first: wp.array[wp.int32]


@wp.struct
class Transmittances:
    """What triangles let through of red, green and blue.

    Attributes:
        instance: Each triangle's casting instance, shape [triangle_count]; empty where all casters are opaque, and
            until :func:`of_batch` says of which batch.
        of_instance: Each casting instance's transmittance, shape [instance_count]; empty where all casters are opaque.
    """

    instance: wp.array[wp.int32]
    of_instance: wp.array[wp.vec3]


@wp.func
def list_triangle(
    lists: BlockerLists, k: wp.int32, t: wp.int32, vertices: wp.array[wp.vec3], indices: wp.array[wp.int32]
):
    """Put triangle t at place k of the lists."""
    lists.number[k] = t
    lists.corner[3 * k] = vertices[indices[3 * t]]
    lists.corner[3 * k + 1] = vertices[indices[3 * t + 1]]
    lists.corner[3 * k + 2] = vertices[indices[3 * t + 2]]


@wp.func
def transmittance_of(transmittances: Transmittances, triangle: wp.int32):
    """Transmittance of a triangle of the batch; 0 for an opaque one."""
    through = wp.vec3(0.0, 0.0, 0.0)
    if transmittances.instance.shape[0] > 0:
        through = transmittances.of_instance[transmittances.instance[triangle]]
    return through


def transmittances_of(casters: Casters, device: str) -> Transmittances:
    """Return the transmittances of casters' triangles, whole where there are flat arrays."""
    transmittances = Transmittances()
    transmittances.instance = wp.empty(0, dtype=wp.int32, device=device)
    transmittances.of_instance = wp.empty(0, dtype=wp.vec3, device=device)
    if not casters.is_opaque:
        if casters.is_flat:
            transmittances.instance = instances_of(np.diff(casters.first_triangle), 0, device)
        by_instance = np.array([i.transmittance for i in casters.instances], np.float32)
        transmittances.of_instance = as_warp(by_instance, wp.vec3, device)
    return transmittances


def instances_of(triangle_counts: NDArray[np.int64], first_instance: int, device: str) -> wp.array[Any]:
    """Return the instance of every triangle, int32, where instances that follow each other have so many."""
    numbers = np.arange(first_instance, first_instance + len(triangle_counts), dtype=np.int32)
    return as_warp(np.repeat(numbers, triangle_counts), wp.int32, device)


def of_batch(transmittances: Transmittances, batch: TriangleBatch) -> Transmittances:
    """Return the transmittances of a batch's triangles."""
    if not let_light_through(transmittances) or transmittances.instance.shape[0] == batch.triangle_count:
        return transmittances
    own: Any = Transmittances()
    own.of_instance = transmittances.of_instance
    own.instance = instances_of(batch.triangle_counts, batch.first_instance, str(batch.triangles.device))
    return own  # type: ignore[no-any-return]


def let_light_through(transmittances: Transmittances) -> bool:
    """Return whether any caster is translucent."""
    return bool(transmittances.of_instance.shape[0] > 0)


class BlockerBins:
    """Lists of triangles by region; memory is kept between frames.

    Args:
        context: Where to run.
    """

    def __init__(self, context: Context) -> None:
        self.context = context
        self._found = wp.empty(0, dtype=wp.uint64, device=context.device)
        self._lists = BlockerLists()
        self._reserve(0)

    @property
    def kept_bytes(self) -> int:
        """Memory that stays alive between frames [bytes]."""
        return int(self._found.capacity + self._lists.corner.capacity + self._lists.number.capacity)

    def _reserve(self, listed_count: int) -> None:
        self._lists.corner = wp.empty(3 * (listed_count + LANES), dtype=wp.vec3, device=self.context.device)
        self._lists.number = wp.empty(listed_count, dtype=wp.int32, device=self.context.device)

    def fill(
        self,
        find: wp.Kernel,
        copy_found: wp.Kernel,
        triangles: TriangleBatch,
        region_count: int,
        inputs: Sequence[Any],
        *,
        extra_counts: int = 0,
    ) -> tuple[BlockerLists, NDArray[np.int64]]:
        """Make the lists.

        Args:
            find: Kernel over blocks of triangles with ``inputs``, vertices and indices, then outputs ``found`` (one
                uint64 a triangle, of any meaning) and ``count`` (of listed triangles, shape [block, region], zeroed).
            copy_found: Kernel over blocks with inputs ``found``, vertices, indices and ``cursor`` (where each block
                goes on in each region's list, shape [block, region]) and output ``lists``.
            triangles: Some of the casters.
            region_count: Number of regions.
            inputs: What ``find`` reads.
            extra_counts: More columns of ``count``, for what ``find`` wants to report.

        Returns:
            The lists, which the next call overwrites, and the sums of the extra counts.
        """
        device, count = self.context.device, triangles.triangle_count
        if self._found.shape[0] < count:
            self._found = wp.empty(count, dtype=wp.uint64, device=device)
        geometry = [triangles.vertices, triangles.triangles]
        blocks = -(-count // int(TRIANGLE_BLOCK))
        in_region = wp.zeros((blocks, region_count + extra_counts), dtype=wp.int32, device=device)
        launch(
            find,
            blocks,
            inputs=[*inputs, *geometry],
            outputs=[self._found, in_region],
            context=self.context,
            block_size=1,
        )
        counted = in_region.numpy()
        begins = exclusive_sums(np.ascontiguousarray(counted[:, :region_count]))
        total = int(begins[-1, -1])
        first = np.append(begins[0], np.int32(total))
        if self._lists.number.shape[0] < total:
            self._reserve(total + total // 4)
        self._lists.first = as_warp(first, wp.int32, device)
        launch(
            copy_found,
            blocks,
            inputs=[self._found, *geometry, as_warp(begins, wp.int32, device)],
            outputs=[self._lists],
            context=self.context,
            block_size=1,
        )
        return self._lists, counted[:, region_count:].sum(axis=0, dtype=np.int64)
