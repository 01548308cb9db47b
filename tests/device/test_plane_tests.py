"""The native test of runs of points against planes, its plain twin, and NumPy."""

import numpy as np
import pytest
import warp as wp

from shadowbench.device.launch import kernel_options
from shadowbench.device.plane_tests import RUN_LENGTH, behind_planes, behind_planes_plain

wp.set_module_options(kernel_options(native=True))


def _asking(function):
    @wp.kernel
    def ask(
        position: wp.array[wp.vec3],
        planes: wp.array[wp.vec4d],
        runs: wp.array[wp.vec4i],
        found: wp.array[wp.uint32],
    ):
        i = wp.tid()
        run = runs[i]
        found[i] = function(position, run[0], run[1], planes, run[2], run[3])

    return ask


ask_native, ask_plain = _asking(behind_planes), _asking(behind_planes_plain)


def _ask(kernel, position, planes, runs):
    found = wp.empty(len(runs), dtype=wp.uint32, device="cpu")
    inputs = [
        wp.array(a, dtype=t, device="cpu") for a, t in ((position, wp.vec3), (planes, wp.vec4d), (runs, wp.vec4i))
    ]
    wp.launch(kernel, dim=len(runs), inputs=inputs, outputs=[found], device="cpu")
    bits = found.numpy()[:, None] >> np.arange(32, dtype=np.uint32) & np.uint32(1)
    return bits.astype(bool)


def _cases(rng):
    """Points, some exactly on planes, and runs of every length, up to the very last point."""
    position = rng.integers(-8, 9, (500, 3)).astype(np.float32) / 4.0
    planes = rng.integers(-3, 4, (40, 4)).astype(np.float64)
    length = rng.integers(1, RUN_LENGTH + 1, 300)
    start = np.where(rng.random(300) < 0.2, 500 - length, rng.integers(0, 500 - length))
    first = rng.integers(0, 41, 300)
    end = np.minimum(first + rng.integers(0, 5, 300), 40)
    return position, planes, np.stack([start, length, first, np.maximum(first, end)], axis=1).astype(np.int32)


@pytest.mark.parametrize("kernel", [ask_native, ask_plain], ids=["native", "plain"])
def test_points_pass_that_are_outside_of_no_plane(kernel):
    position, planes, runs = _cases(np.random.default_rng(1))
    outside = position.astype(np.float64) @ planes[:, :3].T + planes[:, 3] > 0.0  # exact: small multiples of 1/4
    found = _ask(kernel, position, planes, runs)
    passed_any = 0
    for row, (start, length, first, end) in zip(found, runs, strict=True):
        expected = ~outside[start : start + length, first:end].any(axis=1)
        np.testing.assert_array_equal(row[:length], expected)
        assert not row[length:].any()
        passed_any += expected.sum()
    assert passed_any > 1000


def test_the_native_body_rounds_as_its_plain_twin():
    rng = np.random.default_rng(2)
    position = rng.normal(size=(4000, 3)).astype(np.float32)
    # planes through some of the points, where the last bit decides
    normal = rng.normal(size=(400, 3))
    through = position[rng.integers(0, 4000, 400)].astype(np.float64)
    planes = np.concatenate([normal, -(normal * through).sum(axis=1, keepdims=True)], axis=1)
    runs = np.array([(s, 32, k, k + 1) for s in range(0, 4000, 32) for k in range(0, 400, 7)], np.int32)
    native, plain = (_ask(kernel, position, planes, runs) for kernel in (ask_native, ask_plain))
    np.testing.assert_array_equal(native, plain)
