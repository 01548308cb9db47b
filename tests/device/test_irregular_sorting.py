"""Ordering samples: median splits, counting sorts, and lists of triangles, each against NumPy or its plain twin."""

import itertools

import numpy as np
import pytest
import warp as wp

from shadowbench.device.launch import Context, kernel_options, launch
from shadowbench.device.light_samples import exclusive_sums
from shadowbench.device.sample_partition import split_at_median, split_at_median_plainly
from shadowbench.device.sample_scan import SampleArrays, room_for_samples
from shadowbench.device.sample_sorting import (
    Bounds,
    bounds_of,
    bounds_of_plainly,
    count_by_row,
    count_by_row_plainly,
    scatter_by_row,
    scatter_by_row_plainly,
    sort_by_cell,
    sort_by_cell_plainly,
)

wp.set_module_options(kernel_options(native=True))


@wp.kernel
def split(
    first: wp.int32,
    plainly: wp.bool,
    begin: wp.int32,
    middle: wp.int32,
    end: wp.int32,
    axis: wp.int32,
    records: wp.array[wp.vec4],
):
    if plainly:
        split_at_median_plainly(records, begin, middle, end, axis)
    else:
        split_at_median(records, begin, middle, end, axis)


@wp.kernel
def sort(
    first: wp.int32,
    plainly: wp.bool,
    begin: wp.int32,
    end: wp.int32,
    records: wp.array[wp.vec4],
    scratch: wp.array[wp.int32],
    bounds: wp.array[Bounds],
    cells: wp.array[wp.int32],
    samples: SampleArrays,
):
    box = bounds_of(records, begin, end)
    if plainly:
        box = bounds_of_plainly(records, begin, end)
    bounds[0] = box
    per_unit = wp.float32(cells.shape[0] - 1) / wp.max(box[3] - box[0], 1.0e-30)
    if plainly:
        sort_by_cell_plainly(records, begin, end, box[0], per_unit, cells.shape[0] - 1, cells, samples)
    else:
        sort_by_cell(records, begin, end, box[0], per_unit, cells.shape[0] - 1, scratch, cells, samples)


@wp.kernel
def sort_by_row(
    first: wp.int32,
    plainly: wp.bool,
    begin: wp.int32,
    end: wp.int32,
    records: wp.array[wp.vec4],
    strip_of_row: wp.array[wp.int32],
    count: wp.array[wp.int32],
    cursor: wp.array[wp.int32],
    by_strip: wp.array[wp.vec4],
):
    if plainly:
        count_by_row_plainly(records, begin, end, strip_of_row.shape[0], count)
        scatter_by_row_plainly(records, begin, end, strip_of_row, cursor, by_strip)
    else:
        count_by_row(records, begin, end, strip_of_row.shape[0], count)
        scatter_by_row(records, begin, end, strip_of_row, cursor, by_strip)


def some_records(count, kind, rng):
    """Records whose coordinates are spread, tied, equal or sorted; the last component numbers them."""
    values = {
        "spread": lambda: rng.uniform(-1.0, 1.0, (count, 4)),
        "tied": lambda: rng.integers(0, 4, (count, 4)) / 4.0,
        "equal": lambda: np.full((count, 4), 0.25),
        "sorted": lambda: np.sort(rng.uniform(-1.0, 1.0, (count, 4)), axis=0),
        "reversed": lambda: np.sort(rng.uniform(-1.0, 1.0, (count, 4)), axis=0)[::-1],
    }[kind]().astype(np.float32)
    values[:, 3] = np.arange(count, dtype=np.int32).view(np.float32)
    return np.ascontiguousarray(values)


@pytest.mark.parametrize("plainly", [False, True])
@pytest.mark.parametrize("kind", ["spread", "tied", "equal", "sorted", "reversed"])
@pytest.mark.parametrize("count", [1, 2, 3, 10, 64, 5000])
def test_no_record_before_the_median_is_larger_than_one_behind_it(plainly, kind, count):
    rng = np.random.default_rng(count)
    before = some_records(count + 4, kind, rng)
    for axis in (0, 1):
        records = wp.array(before, dtype=wp.vec4, device="cpu", copy=True)
        begin, end = 2, 2 + count
        middle = begin + count // 2
        launch(split, 1, [plainly, begin, middle, end, axis], [records], context=Context())
        after = records.numpy()
        np.testing.assert_array_equal(after[:begin], before[:begin])
        np.testing.assert_array_equal(after[end:], before[end:])
        numbers = after[begin:end, 3].copy().view(np.int32)
        np.testing.assert_array_equal(np.sort(numbers), np.arange(begin, end))
        np.testing.assert_array_equal(after[begin:end], before[numbers])
        if middle > begin:
            assert after[begin:middle, axis].max() <= after[middle:end, axis].min()


@pytest.mark.parametrize("kind", ["spread", "tied", "equal", "sorted"])
@pytest.mark.parametrize("count", [0, 1, 17, 3000])
def test_the_native_sort_into_cells_means_the_plain_one_and_keeps_the_order_in_a_cell(kind, count):
    records = wp.array(some_records(count + 3, kind, np.random.default_rng(7)), dtype=wp.vec4, device="cpu")
    results = []
    for plainly in (False, True):
        bounds = wp.zeros(1, dtype=Bounds, device="cpu")
        cells = wp.zeros(65, dtype=wp.int32, device="cpu")
        samples = room_for_samples(count + 3, "cpu")
        scratch = wp.empty(count + 3, dtype=wp.int32, device="cpu")
        launch(sort, 1, [plainly, 1, 1 + count, records, scratch], [bounds, cells, samples], context=Context())
        results.append([a.numpy() for a in (bounds, cells, samples.x, samples.y, samples.depth, samples.source)])
    for native, plain in zip(*results, strict=True):
        np.testing.assert_array_equal(native, plain)
    _, cells, x, _, _, source = results[0]
    assert (cells[0], cells[-1]) == (1, 1 + count)
    for begin, end in itertools.pairwise(cells):
        assert (np.diff(source[begin:end]) > 0).all()
        assert end == 1 + count or begin == end or x[begin:end].max() <= x[end : 1 + count].min()


@pytest.mark.parametrize("kind", ["spread", "tied", "equal", "sorted"])
def test_the_native_sort_into_strips_means_the_plain_one_and_numpys(kind):
    count, row_count = 3000, 64
    before = some_records(count, kind, np.random.default_rng(8)) * np.float32([1.0, 1.1, 1.0, 1.0])  # some outside
    records = wp.array(before, dtype=wp.vec4, device="cpu")
    strip_of_row = np.sort(np.random.default_rng(9).integers(0, 5, row_count)).astype(np.int32)
    row = np.clip((before[:, 1] + 1.0) * np.float32(0.5 * row_count), 0, row_count - 1).astype(int)
    in_row = np.bincount(row, minlength=row_count)
    in_strip = np.bincount(strip_of_row[row], minlength=5)
    for plainly in (False, True):
        counted = wp.zeros(row_count, dtype=wp.int32, device="cpu")
        cursor = wp.array(np.cumsum(in_strip) - in_strip, dtype=wp.int32, device="cpu")
        by_strip = wp.zeros(count, dtype=wp.vec4, device="cpu")
        rows = wp.array(strip_of_row, dtype=wp.int32, device="cpu")
        launch(sort_by_row, 1, [plainly, 0, count, records, rows], [counted, cursor, by_strip], context=Context())
        np.testing.assert_array_equal(counted.numpy(), in_row)
        expected = before[np.argsort(strip_of_row[row], kind="stable")]
        np.testing.assert_array_equal(by_strip.numpy(), expected)


def test_exclusive_sums_lay_columns_behind_each_other_and_blocks_within_them():
    begins = exclusive_sums(np.array([[2, 0, 1], [3, 4, 0]], np.int32))
    np.testing.assert_array_equal(begins, [[0, 5, 9], [2, 5, 10], [5, 9, 10]])
