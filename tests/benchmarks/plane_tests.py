"""The native test of runs of points against planes beside its plain twin, in the same interleaved rounds.

    python tests/benchmarks/plane_tests.py [--points 1000000] [--rounds 15]

Points round boxes are tested against the planes of the boxes' shadow volumes, as when outlines are filled: on one
thread, in runs of 32, first against the leading planes and, if any point passed, against the others. Printed are the
least times and the median over the rounds of plain over native, for runs along a picture's rows (neighbours pass or
fail together) and for runs of points in no order.
"""

import argparse
import time

import numpy as np
import warp as wp

from shadowbench.device.launch import kernel_options
from shadowbench.device.plane_tests import behind_planes, behind_planes_plain

wp.set_module_options(kernel_options(native=True))


def _testing(function):
    @wp.kernel
    def count_behind(
        position: wp.array[wp.vec3], planes: wp.array[wp.vec4d], leading: wp.int32, found: wp.array[wp.int32]
    ):
        total = wp.int32(0)
        for start in range(0, position.shape[0] - 31, 32):
            passed = function(position, start, 32, planes, 0, leading)
            if passed != wp.uint32(0):
                passed = passed & function(position, start, 32, planes, leading, planes.shape[0])
            for lane in range(32):
                total += wp.int32((passed >> wp.uint32(lane)) & wp.uint32(1))
        found[0] = total

    return count_behind


KERNELS = {"native": _testing(behind_planes), "plain": _testing(behind_planes_plain)}


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--points", type=int, default=1_000_000)
    parser.add_argument("--rounds", type=int, default=15)
    arguments = parser.parse_args()
    rng = np.random.default_rng(1)
    width = 1000
    line = np.arange(arguments.points)
    across, down = line % width / width, line // width / (arguments.points // width)
    ground = np.stack([4.0 * across - 2.0, np.zeros(len(line)), 4.0 * down - 2.0], axis=1)
    towards = np.array((0.4, 1.0, 0.3))
    for name, points in (("along rows", ground), ("in no order", rng.permutation(ground))):
        planes = _volume(np.array((0.6, 0.8, 0.5)), np.array((0.0, 0.8, 0.0)), towards)
        _compare(name, points.astype(np.float32), planes, arguments.rounds)


def _volume(half, centre, towards):
    """Planes of a box's shadow volume: three lit faces, and the sides through their outline."""
    normals = [np.eye(3)[axis] * np.sign(towards[axis]) for axis in range(3)]
    for axis in range(3):
        side = np.cross(np.eye(3)[axis], towards)
        normals += [side / np.linalg.norm(side), -side / np.linalg.norm(side)]
    return np.array([(*n, -(n @ centre) - np.abs(n) @ half) for n in normals])


def _compare(name, points, planes, round_count):
    position = wp.array(points, dtype=wp.vec3, device="cpu")
    on_device = wp.array(planes, dtype=wp.vec4d, device="cpu")
    found = {kind: wp.zeros(1, dtype=wp.int32, device="cpu") for kind in KERNELS}
    times = {kind: np.empty(round_count) for kind in KERNELS}
    for number in range(-1, round_count):  # the first round warms up
        for kind, kernel in KERNELS.items():
            begin = time.perf_counter()
            wp.launch(kernel, dim=1, inputs=[position, on_device, 3], outputs=[found[kind]], device="cpu")
            if number >= 0:
                times[kind][number] = (time.perf_counter() - begin) * 1e3
    assert found["native"].numpy()[0] == found["plain"].numpy()[0]
    share = found["native"].numpy()[0] / len(points)
    ratio = np.median(times["plain"] / times["native"])
    least = ", ".join(f"{kind} {samples.min():.2f} ms" for kind, samples in times.items())
    print(f"{name}: {share:.0%} of {len(points)} points pass; {least}; plain takes {ratio:.1f} times as long")


if __name__ == "__main__":
    main()
