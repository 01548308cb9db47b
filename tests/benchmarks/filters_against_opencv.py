"""Measures the filters of maps against OpenCV's, on one thread and on two, in the same rounds.

    python tests/benchmarks/filters_against_opencv.py [--size 2048] [--rounds 41] [--threads 1 2]

Both convolve the same float32 map of one or two channels with a 7 x 7 Gauss window (edges repeated), take 7 x 7 maxima,
and make a full chain of area means (OpenCV's ``GaussianBlur``, ``dilate`` and repeated ``resize`` with INTER_AREA) into
memory of their own; OpenCV's number of threads is set to ours. Rounds alternate between the two; printed are medians,
the fastest rounds, and the ratio of ours to OpenCV's, of which the median is taken over rounds. On a machine with
other work on its cores the ratio of the fastest rounds says more. Without OpenCV (the ``test`` extra) there is nothing
to compare with, and the program says so.
"""

from __future__ import annotations

import argparse
import statistics
import sys
import time
from collections.abc import Callable
from itertools import pairwise

import numpy as np
import warp as wp
from rich.console import Console
from rich.table import Table

from shadowbench.device.filter_weights import gauss_sigma, tap_weights
from shadowbench.device.launch import Context
from shadowbench.device.mip_chains import MipChain
from shadowbench.device.separable_filters import convolve, keep_maxima

try:
    import cv2
except ImportError:
    print("OpenCV is missing, so there is nothing to compare with; install shadowbench[test]", file=sys.stderr)
    sys.exit(0)

WIDTH = 7

Task = Callable[[], object]


def tasks(size: int, threads: int) -> list[tuple[str, Task, Task]]:
    """Return each task's name, ours and OpenCV's."""
    context = Context(threads=threads)
    weights = tap_weights("gauss", WIDTH)
    made: list[tuple[str, Task, Task]] = []
    for channels in (1, 2):
        values = np.random.default_rng(channels).random((size, size, channels), dtype=np.float32)
        source = wp.array(values[None], dtype=wp.float32, device="cpu")
        target = wp.zeros_like(source)
        result = np.empty_like(values)
        made.append(
            (
                f"{WIDTH}x{WIDTH} Gauss, {channels} channel{'s' * (channels - 1)}",
                lambda source=source, target=target: convolve(source, target, weights, context),
                lambda values=values, result=result: cv2.GaussianBlur(
                    values, (WIDTH, WIDTH), gauss_sigma(WIDTH), dst=result, borderType=cv2.BORDER_REPLICATE
                ),
            )
        )
    plane = np.random.default_rng(1).random((size, size), dtype=np.float32)
    dilated, window = np.empty_like(plane), np.ones((WIDTH, WIDTH), np.uint8)
    source = wp.array(plane[None, :, :, None], dtype=wp.float32, device="cpu")
    target = wp.zeros_like(source)
    chain = MipChain(1, size, context)
    chain.level(0).assign(source)
    levels = [plane, *(np.empty((n, n), np.float32) for n in chain_below(size))]

    def their_chain() -> None:
        for finer, coarser in pairwise(levels):
            cv2.resize(finer, coarser.shape, dst=coarser, interpolation=cv2.INTER_AREA)

    return [
        *made,
        (
            f"{WIDTH}x{WIDTH} maxima",
            lambda: keep_maxima(source, target, WIDTH, context),
            lambda: cv2.dilate(plane, window, dst=dilated),
        ),
        ("mip chain of means", chain.fill_with_means, their_chain),
    ]


def chain_below(size: int) -> list[int]:
    """Sizes of the levels after the first."""
    return [size >> level for level in range(1, size.bit_length())]


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description="Filters of maps against OpenCV's.")
    parser.add_argument("--size", type=int, default=2048)
    parser.add_argument("--rounds", type=int, default=41)
    parser.add_argument("--threads", type=int, nargs="+", default=[1, 2])
    options = parser.parse_args()
    table = Table(title=f"{options.size}² texels, {options.rounds} rounds; OpenCV {cv2.__version__}")
    for heading in ("filter", "threads", "ours ms", "OpenCV ms", "ratio", "fastest: ours", "OpenCV", "ratio"):
        table.add_column(heading, justify="left" if heading == "filter" else "right")
    for threads in options.threads:
        cv2.setNumThreads(threads)
        for name, ours, theirs in tasks(options.size, threads):
            times: list[tuple[float, float]] = []
            for _ in range(options.rounds + 1):
                samples = []
                for task in (ours, theirs):
                    begin = time.perf_counter()
                    task()
                    samples.append((time.perf_counter() - begin) * 1.0e3)
                times.append((samples[0], samples[1]))
            columns = list(zip(*times[1:], strict=True))  # the first round warms up
            medians = [statistics.median(column) for column in columns]
            fastest = [min(column) for column in columns]
            ratio = statistics.median(a / b for a, b in times[1:])
            table.add_row(
                *(name, str(threads), f"{medians[0]:.2f}", f"{medians[1]:.2f}", f"{ratio:.2f}"),
                *(f"{fastest[0]:.2f}", f"{fastest[1]:.2f}", f"{fastest[0] / fastest[1]:.2f}"),
            )
    Console(width=None if sys.stdout.isatty() else 110).print(table)


if __name__ == "__main__":
    main()
