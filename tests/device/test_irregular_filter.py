"""The float32 filter of the irregular rasterisers: never wrong where it is certain, and native bodies mean the plain
ones."""

import numpy as np
import pytest
import warp as wp
from irregular import LIGHTS, needles, soup_of

from shadowbench.device.blocker_batches import BATCH, LANES, prepare_batch
from shadowbench.device.blockers import Blocker, blocker_of
from shadowbench.device.exact_decision import is_shadowed_by
from shadowbench.device.launch import Context, kernel_options, launch
from shadowbench.device.light_samples import LightSamples, lay_down
from shadowbench.device.sample_scan import (
    DOUBTFUL_ROOM,
    SampleArrays,
    light_fully,
    room_for_samples,
    scan,
    scan_plainly,
)
from shadowbench.device.sample_space import SHADOWED, SampleSpace

wp.set_module_options(kernel_options(native=True))

UNTOUCHED, SURE, DOUBTED = 0, 1, 2


@wp.kernel
def judge_natively(
    first: wp.int32,
    space: SampleSpace,
    corners: wp.array2d[wp.vec3],
    transmittance: wp.vec3,
    samples: SampleArrays,
    depth: wp.array[wp.float32],
    begin: wp.int32,
    end: wp.int32,
    verdict: wp.array2d[wp.int32],
    tested: wp.array[wp.int32],
):
    """Scan all samples with each triangle, restoring the depths in between."""
    doubtful = wp.zeros(shape=(DOUBTFUL_ROOM,), dtype=wp.int32)
    for t in range(corners.shape[0]):
        blocker = blocker_of(space, corners[t, 0], corners[t, 1], corners[t, 2])
        i = begin
        while i < end:
            found = scan(samples, blocker, transmittance, i, end, doubtful)
            for k in range(found.doubtful_count):
                verdict[t, doubtful[k]] = 2
            tested[t] = tested[t] + found.tested_count
            i = found.next
        for j in range(depth.shape[0]):
            if samples.depth[j] == SHADOWED:
                verdict[t, j] = 1
            samples.depth[j] = depth[j]


@wp.kernel
def judge_plainly(
    first: wp.int32,
    space: SampleSpace,
    corners: wp.array2d[wp.vec3],
    transmittance: wp.vec3,
    samples: SampleArrays,
    depth: wp.array[wp.float32],
    begin: wp.int32,
    end: wp.int32,
    verdict: wp.array2d[wp.int32],
    tested: wp.array[wp.int32],
):
    doubtful = wp.zeros(shape=(DOUBTFUL_ROOM,), dtype=wp.int32)
    for t in range(corners.shape[0]):
        blocker = blocker_of(space, corners[t, 0], corners[t, 1], corners[t, 2])
        i = begin
        while i < end:
            found = scan_plainly(samples, blocker, transmittance, i, end, doubtful)
            for k in range(found.doubtful_count):
                verdict[t, doubtful[k]] = 2
            tested[t] = tested[t] + found.tested_count
            i = found.next
        for j in range(depth.shape[0]):
            if samples.depth[j] == SHADOWED:
                verdict[t, j] = 1
            samples.depth[j] = depth[j]


@wp.kernel
def decide_pairs(
    first: wp.int32,
    space: SampleSpace,
    corners: wp.array2d[wp.vec3],
    samples: SampleArrays,
    position: wp.array[wp.vec3],
    shadowed: wp.array2d[wp.int32],
):
    i = wp.tid() + first
    p = position[samples.source[i]]
    for t in range(corners.shape[0]):
        if is_shadowed_by(space.light, space.tolerance, p, corners[t, 0], corners[t, 1], corners[t, 2]):
            shadowed[t, i] = 1


def laid_down(world, receivers, light, *, translucency=False):
    """Samples of each window as arrays, in the order of the receivers."""
    visibility = wp.empty(receivers.count, dtype=wp.float32, device="cpu")
    placed = LightSamples(Context())
    for window in placed.place_receivers(receivers, world.lights[light], world, visibility):
        laid = wp.empty(window.count, dtype=wp.vec4, device="cpu")
        lay_down(window, laid, Context())
        records = laid.numpy()
        samples = room_for_samples(window.count, "cpu", translucency=translucency)
        for k, array in enumerate((samples.x, samples.y, samples.depth)):
            array.numpy()[: window.count] = records[:, k]
        samples.source.numpy()[: window.count] = records[:, 3].copy().view(np.int32)
        yield window, samples


def judged(kernel, window, samples, corners, begin, end, transmittance=(0.0, 0.0, 0.0)):
    verdict = wp.zeros((len(corners), window.count), dtype=wp.int32, device="cpu")
    tested = wp.zeros(len(corners), dtype=wp.int32, device="cpu")
    depth = wp.array(samples.depth.numpy()[: window.count].copy(), dtype=wp.float32, device="cpu")
    inputs = [window.space, corners, wp.vec3(*transmittance), samples, depth, begin, end]
    launch(kernel, 1, inputs, [verdict, tested], context=Context())
    return verdict.numpy(), tested.numpy()


@pytest.mark.parametrize("light", LIGHTS)
@pytest.mark.parametrize("world", [lambda: soup_of(60), needles])
def test_what_the_filter_is_certain_of_is_what_the_predicate_says(world, light):
    placed, receivers = world()
    corners = wp.array(placed.vertices[placed.triangles], dtype=wp.vec3, device="cpu")
    for window, samples in laid_down(placed, receivers, light):
        verdict, _ = judged(judge_natively, window, samples, corners, 0, window.count)
        shadowed = wp.zeros((len(corners), window.count), dtype=wp.int32, device="cpu")
        position = receivers.on("cpu").position
        launch(decide_pairs, window.count, [window.space, corners, samples, position], [shadowed], context=Context())
        exact = shadowed.numpy() == 1
        assert exact[verdict == SURE].all()
        assert not exact[verdict == UNTOUCHED].any()


def test_few_pairs_of_a_soup_are_doubtful():
    world, receivers = soup_of(60)
    corners = wp.array(world.vertices[world.triangles], dtype=wp.vec3, device="cpu")
    for light in ("directional", "spot", "point far away"):
        for window, samples in laid_down(world, receivers, light):
            verdict, _ = judged(judge_natively, window, samples, corners, 0, window.count)
            # receivers on edges and vertices are doubtful to the triangles that share them, hardly any others are
            assert (verdict == DOUBTED).mean() < 2.0 / corners.shape[0]


@pytest.mark.parametrize("light", ["directional", "spot", "point inside"])
@pytest.mark.parametrize(("begin", "length"), [(0, 1), (3, 15), (5, 16), (7, 18), (1, 997)])
def test_the_native_scan_means_the_plain_one(light, begin, length):
    world, receivers = soup_of(60)
    corners = wp.array(world.vertices[world.triangles], dtype=wp.vec3, device="cpu")
    for window, samples in laid_down(world, receivers, light):
        end = min(begin + length, window.count)
        native, tested = judged(judge_natively, window, samples, corners, begin, end)
        plain, tested_plainly = judged(judge_plainly, window, samples, corners, begin, end)
        np.testing.assert_array_equal(native, plain)
        np.testing.assert_array_equal(tested, tested_plainly)


@pytest.mark.parametrize("light", ["directional", "spot", "point inside"])
def test_the_native_scan_lets_as_much_light_through_as_the_plain_one(light):
    world, receivers = soup_of(60)
    corners = wp.array(world.vertices[world.triangles], dtype=wp.vec3, device="cpu")
    for window, samples in laid_down(world, receivers, light, translucency=True):
        after = []
        for kernel in (judge_natively, judge_plainly):
            light_fully(samples)
            verdict, _ = judged(kernel, window, samples, corners, 0, window.count, transmittance=(0.9, 0.5, 0.0))
            assert not (verdict == SURE).any()  # no depth was changed
            after.append(
                [channel.numpy()[: window.count].copy() for channel in (samples.red, samples.green, samples.blue)]
            )
        np.testing.assert_array_equal(after[0], after[1])
        assert len(np.unique(after[0][0])) >= 2


@wp.kernel
def prepare_both_ways(
    first: wp.int32,
    space: SampleSpace,
    corner: wp.array[wp.vec3],
    count: wp.int32,
    in_batches: wp.array[Blocker],
    one_by_one: wp.array[Blocker],
):
    """Prepare ``count`` triangles; one that lies outside the window may come out any way."""
    batch = wp.zeros(shape=(BATCH,), dtype=Blocker)
    for begin in range(0, count, BATCH):
        here = wp.min(BATCH, count - begin)
        prepare_batch(space, corner, begin, here, batch)
        for j in range(here):
            in_batches[begin + j] = batch[j]
    for t in range(count):
        one_by_one[t] = blocker_of(space, corner[3 * t], corner[3 * t + 1], corner[3 * t + 2])


@pytest.mark.parametrize("light", LIGHTS)
@pytest.mark.parametrize("world", [lambda: soup_of(60), needles, lambda: soup_of(5000)])
def test_triangles_prepared_in_batches_are_those_prepared_one_by_one(world, light):
    placed, receivers = world()
    corners = placed.vertices[placed.triangles].reshape(-1, 3)
    count = len(corners) // 3
    padded = wp.array(np.pad(corners, ((0, 3 * LANES), (0, 0))), dtype=wp.vec3, device="cpu")
    for window, _ in laid_down(placed, receivers, light):
        batches, singles = (wp.zeros(count, dtype=Blocker, device="cpu") for _ in range(2))
        launch(prepare_both_ways, 1, [window.space, padded, count], [batches, singles], context=Context())
        np.testing.assert_array_equal(batches.numpy(), singles.numpy())
