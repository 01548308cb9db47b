"""Binning triangles into strips: each native body against its plain twin, and both against NumPy."""

import numpy as np
import pytest
import warp as wp

from shadowbench.device.blocker_bins import BlockerLists
from shadowbench.device.launch import Context, kernel_options, launch
from shadowbench.device.sample_space import SampleSpace, sample_spaces
from shadowbench.device.strip_listing import (
    count_strips,
    count_strips_plainly,
    list_in_strips,
    list_in_strips_plainly,
    strips_met,
    strips_met_plainly,
)
from shadowbench.scene import DirectionalLight, PointLight, SpotLight

wp.set_module_options(kernel_options(native=True))

ROWS, STRIPS = 256, 20
LIGHTS = {
    "directional": DirectionalLight((0.4, 1.0, 0.3)),
    "spot": SpotLight((1.5, 4.0, 1.0), (-1.5, -4.0, -1.0), 50.0),
    "point": PointLight((0.2, 0.6, 0.1)),
}


@wp.kernel
def bin_triangles(
    first: wp.int32,
    plainly: wp.bool,
    space: SampleSpace,
    strip_of_row: wp.array[wp.int32],
    vertices: wp.array[wp.vec3],
    indices: wp.array[wp.int32],
    begin: wp.int32,
    end: wp.int32,
    found: wp.array[wp.uint64],
    count: wp.array[wp.int32],
):
    if plainly:
        strips_met_plainly(space, strip_of_row, vertices, indices, begin, end, found)
        count_strips_plainly(found, begin, end, count)
    else:
        strips_met(space, strip_of_row, vertices, indices, begin, end, found)
        count_strips(found, begin, end, count)


@wp.kernel
def copy_triangles(
    first: wp.int32,
    plainly: wp.bool,
    found: wp.array[wp.uint64],
    vertices: wp.array[wp.vec3],
    indices: wp.array[wp.int32],
    begin: wp.int32,
    end: wp.int32,
    cursor: wp.array[wp.int32],
    lists: BlockerLists,
):
    if plainly:
        list_in_strips_plainly(found, vertices, indices, begin, end, cursor, lists)
    else:
        list_in_strips(found, vertices, indices, begin, end, cursor, lists)


def geometry(count):
    """Triangles small and large, some of them beyond the window, with shared vertices."""
    rng = np.random.default_rng(count)
    vertices = rng.uniform(-3.0, 3.0, (max(count, 3), 3)).astype(np.float32)
    indices = rng.integers(0, len(vertices), (count, 3)).astype(np.int32)
    small = rng.random(count) < 0.5
    indices[small] = indices[small, :1]
    return vertices, indices


@pytest.mark.parametrize("light", LIGHTS)
@pytest.mark.parametrize("count", [1, 3, 4, 5, 1001])
def test_native_binning_means_the_plain_one(count, light):
    vertices, indices = geometry(count)
    space = sample_spaces(LIGHTS[light], 3.0, np.full(3, -1.0), np.full(3, 1.0))[0]
    strip_of_row = np.sort(np.random.default_rng(1).integers(0, STRIPS, ROWS)).astype(np.int32)
    on_device = [
        wp.array(strip_of_row, dtype=wp.int32, device="cpu"),
        wp.array(vertices, dtype=wp.vec3, device="cpu"),
        wp.array(indices.reshape(-1), dtype=wp.int32, device="cpu"),
    ]
    binned = []
    for plainly in (False, True):
        found = wp.zeros(count, dtype=wp.uint64, device="cpu")
        counted = wp.zeros(STRIPS, dtype=wp.int32, device="cpu")
        launch(bin_triangles, 1, [plainly, space, *on_device, 0, count], [found, counted], context=Context())
        binned.append((found.numpy(), counted.numpy()))
    np.testing.assert_array_equal(binned[0][0], binned[1][0])
    np.testing.assert_array_equal(binned[0][1], binned[1][1])
    first, after = (binned[0][0] & 0xFFFFFFFF).astype(int), (binned[0][0] >> np.uint64(32)).astype(int)
    met = (np.arange(STRIPS) >= first[:, None]) & (np.arange(STRIPS) < after[:, None])
    np.testing.assert_array_equal(binned[0][1], met.sum(axis=0))


def test_native_listing_means_the_plain_one_and_keeps_file_order():
    count = 500
    vertices, indices = geometry(count)
    rng = np.random.default_rng(2)
    first = rng.integers(0, STRIPS, count)
    after = np.minimum(first + rng.integers(0, 4, count), STRIPS)
    found = wp.array(
        (after.astype(np.uint64) << np.uint64(32)) | first.astype(np.uint64), dtype=wp.uint64, device="cpu"
    )
    met = (np.arange(STRIPS) >= first[:, None]) & (np.arange(STRIPS) < after[:, None])
    in_strip = met.sum(axis=0)
    begins = np.cumsum(in_strip) - in_strip
    expected = np.concatenate([np.flatnonzero(met[:, s]) for s in range(STRIPS)])
    for plainly in (False, True):
        lists = BlockerLists()
        lists.number = wp.zeros(len(expected), dtype=wp.int32, device="cpu")
        lists.corner = wp.zeros(3 * len(expected), dtype=wp.vec3, device="cpu")
        on_device = [
            wp.array(vertices, dtype=wp.vec3, device="cpu"),
            wp.array(indices.reshape(-1), dtype=wp.int32, device="cpu"),
        ]
        cursor = wp.array(begins.astype(np.int32), dtype=wp.int32, device="cpu")
        launch(copy_triangles, 1, [plainly, found, *on_device, 0, count], [cursor, lists], context=Context())
        np.testing.assert_array_equal(lists.number.numpy(), expected)
        np.testing.assert_array_equal(lists.corner.numpy().reshape(-1, 3, 3), vertices[indices[expected]])
        np.testing.assert_array_equal(cursor.numpy(), begins + in_strip)
