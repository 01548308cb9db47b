"""Measures the depth rasteriser against OpenGL on the CPU (Mesa's llvmpipe), one thread each, in the same rounds.

Both clear a float32 depth buffer and draw the same vertices with the same projection: random equilateral triangles of
constant total area in a box above a ground of two triangles (after Aila and Laine 2004), seen by a slanted directional
light. Time is wall time from the clear to the finished picture, vertex transformation included, vertex buffers
uploaded beforehand. Rounds alternate between the two; a ratio is the median of the rounds' ratios. The pictures are
compared too. Then the rasteriser is measured against itself on more threads.

Run it with the ``peers`` extra and Mesa installed (Debian: ``apt-get install libegl1 libgl1-mesa-dri``)::

    python tests/benchmarks/depth_rasterizer_against_opengl.py --triangles 1000 100000 --resolutions 512 2048
"""

from __future__ import annotations

import argparse
import os
import statistics
import sys
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

BOX = ((-1.0, 0.05, -1.0), (1.0, 1.0, 1.0))
GROUND = 4.0
TOTAL_AREA = 4.0
TOWARDS_LIGHT = (0.35, 0.9, 0.25)

VERTEX_SHADER = """
#version 330
uniform mat4 clip_from_world;
in vec3 position;
void main() { gl_Position = clip_from_world * vec4(position, 1.0); }
"""
FRAGMENT_SHADER = """
#version 330
void main() {}
"""

Draw = Callable[[], None]


def random_triangles(count: int) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
    """Vertices [n, 3] and triangles [n, 3]: ``count`` triangles in the box, then two of the ground."""
    random = np.random.default_rng(1)
    centre = random.uniform(*BOX, (count, 1, 3))
    across, other = random.normal(size=(2, count, 3))
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    along = np.cross(across, other)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    circumradius = np.sqrt(TOTAL_AREA / count * 4.0 / 27.0**0.5)
    angle = np.arange(3)[:, None] * (2.0 * np.pi / 3.0)
    corners = centre + circumradius * (np.cos(angle) * across[:, None] + np.sin(angle) * along[:, None])
    ground = np.array([(-GROUND, 0, -GROUND), (GROUND, 0, -GROUND), (GROUND, 0, GROUND), (-GROUND, 0, GROUND)])
    vertices = np.concatenate([corners.reshape(-1, 3), ground]).astype(np.float32)
    triangles = np.arange(3 * count).reshape(-1, 3)
    halves = 3 * count + np.array([[0, 2, 1], [0, 3, 2]])
    return vertices, np.concatenate([triangles, halves]).astype(np.int32)


def light_projection(vertices: NDArray[np.float32], fit: str) -> NDArray[np.float64]:
    """Rows (u, v, depth, 1): the window fits the whole scene or the triangles alone, the depth always the scene."""
    forward = -np.array(TOWARDS_LIGHT) / np.linalg.norm(TOWARDS_LIGHT)
    right = np.cross(forward, (0.0, 1.0, 0.0))
    right /= np.linalg.norm(right)
    axes = np.stack([right, np.cross(forward, right), forward])
    along = vertices.astype(np.float64) @ axes.T
    low, high = along.min(axis=0), along.max(axis=0)
    if fit == "triangles":
        low[:2], high[:2] = along[:-4, :2].min(axis=0), along[:-4, :2].max(axis=0)
    margin = 1.0e-3
    projection = np.eye(4)
    projection[:3, :3] = axes / (high - low + 2.0 * margin)[:, None]
    projection[:3, 3] = -(low - margin) / (high - low + 2.0 * margin)
    return projection


class OpenGL:
    """A depth-only OpenGL context without a window."""

    def __init__(self) -> None:
        try:
            import moderngl
        except ImportError:
            sys.exit("moderngl is missing; install shadowbench[peers]")
        try:
            self.context = moderngl.create_context(standalone=True, backend="egl")  # type: ignore[arg-type]
        except Exception as error:  # noqa: BLE001 - whatever the driver raises
            sys.exit(f"no OpenGL context ({error}); install Mesa, for instance libegl1 and libgl1-mesa-dri")
        self.renderer: str = self.context.info["GL_RENDERER"]
        self.program = self.context.program(vertex_shader=VERTEX_SHADER, fragment_shader=FRAGMENT_SHADER)
        self.depth_test = moderngl.DEPTH_TEST

    def prepare(
        self, vertices: NDArray[np.float32], triangles: NDArray[np.int32], projection: NDArray[np.float64], size: int
    ) -> tuple[Draw, Callable[[], NDArray[np.float32]]]:
        """Return what draws a picture and what reads it back."""
        # v = 0 is the first row of the texture, so that pictures compare row by row
        clip_from_world = 2.0 * projection - projection[3]
        clip_from_world[3] = projection[3]
        self.program["clip_from_world"].write(clip_from_world.T.astype(np.float32).tobytes())  # type: ignore[union-attr]
        mesh = self.context.vertex_array(
            self.program,
            [(self.context.buffer(vertices.tobytes()), "3f", "position")],
            index_buffer=self.context.buffer(triangles.tobytes()),
            index_element_size=4,
        )
        texture = self.context.depth_texture((size, size))
        target = self.context.framebuffer(depth_attachment=texture)

        def draw() -> None:
            target.use()
            target.clear(depth=1.0)
            mesh.render()
            self.context.finish()

        self.context.enable_only(self.depth_test)
        return draw, lambda: np.frombuffer(texture.read(), np.float32).reshape(size, size)


def prepare_ours(
    vertices: NDArray[np.float32],
    triangles: NDArray[np.int32],
    projection: NDArray[np.float64],
    size: int,
    threads: int,
) -> tuple[Draw, Callable[[], NDArray[np.float32]]]:
    """Return what draws a picture and what reads it back."""
    import warp as wp

    from shadowbench.device.depth_rasterizer import DepthRasterizer
    from shadowbench.device.launch import Context

    rasterizer = DepthRasterizer(size, size, Context(threads=threads))
    on_device: tuple[Any, Any] = (
        wp.array(vertices, dtype=wp.vec3, device="cpu"),
        wp.array(triangles, dtype=wp.int32, device="cpu"),
    )

    def draw() -> None:
        rasterizer.clear()
        rasterizer.draw(*on_device, projection, near=None)

    return draw, lambda: np.asarray(rasterizer.depth.numpy())


def alternate(first: Draw, second: Draw, rounds: int) -> tuple[float, float, float]:
    """Median milliseconds of each over alternating rounds, and the median ratio of first to second."""
    times: list[tuple[float, float]] = []
    for round_ in range(rounds + 1):
        samples = []
        for draw in (first, second):
            begin = time.perf_counter()
            draw()
            samples.append((time.perf_counter() - begin) * 1.0e3)
        if round_ > 0:  # the first warms up
            times.append((samples[0], samples[1]))
    medians = [statistics.median(column) for column in zip(*times, strict=True)]
    return medians[0], medians[1], statistics.median(a / b for a, b in times)


def pin_to(cpus: set[int]) -> None:
    """Restrict this thread, and those that it starts, to some of the machine's processors, where the system can."""
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, cpus)


def main() -> None:
    parser = argparse.ArgumentParser(description="The depth rasteriser against OpenGL on the CPU.")
    parser.add_argument("--triangles", type=int, nargs="+", default=[1_000, 10_000, 100_000, 1_000_000])
    parser.add_argument("--resolutions", type=int, nargs="+", default=[512, 1024, 2048])
    parser.add_argument("--fit", choices=["scene", "triangles"], default="scene", help="what the light's window fits")
    parser.add_argument("--rounds", type=int, default=15)
    parser.add_argument("--threads", type=int, default=2, help="threads to compare with one; 1 for no comparison")
    options = parser.parse_args()

    # llvmpipe with 0 threads rasterises in the calling thread; read once, when the driver starts
    os.environ.setdefault("LP_NUM_THREADS", "0")
    os.environ.setdefault("LIBGL_ALWAYS_SOFTWARE", "1")
    everywhere = os.sched_getaffinity(0) if hasattr(os, "sched_getaffinity") else set()
    pin_to({max(everywhere)} if everywhere else set())
    opengl = OpenGL()
    cases = [(count, size) for count in options.triangles for size in options.resolutions]
    pictures = {count: random_triangles(count) for count in options.triangles}

    console = Console(width=None if sys.stdout.isatty() else 110)
    table = Table(title=f"One thread each, median of {options.rounds} rounds; OpenGL is {opengl.renderer}")
    for heading in ("triangles", "texels", "OpenGL ms", "ours ms", "OpenGL / ours", "hit or miss", "depth"):
        table.add_column(heading, justify="right")
    for count, size in cases:
        vertices, triangles = pictures[count]
        projection = light_projection(vertices, options.fit)
        theirs, read_theirs = opengl.prepare(vertices, triangles, projection, size)
        ours, read_ours = prepare_ours(vertices, triangles, projection, size, 1)
        times = alternate(theirs, ours, options.rounds)
        a, b = read_theirs(), read_ours()
        table.add_row(
            *(f"{count:,}", f"{size}²", f"{times[0]:.2f}", f"{times[1]:.2f}", f"{times[2]:.2f}"),
            *(str(((a < 1.0) != (b < 1.0)).sum()), str((np.abs(a - b) > 1.0e-4).sum())),
        )
    console.print(table)
    console.print("hit or miss: texels that one covers and the other does not; depth: texels that differ by over 1e-4")

    if options.threads > 1:
        pin_to(everywhere)
        table = Table(title=f"1 thread against {options.threads}, median of {options.rounds} rounds")
        for heading in ("triangles", "texels", "1 thread ms", f"{options.threads} threads ms", "1 / several"):
            table.add_column(heading, justify="right")
        for count, size in cases:
            vertices, triangles = pictures[count]
            projection = light_projection(vertices, options.fit)
            one, read_one = prepare_ours(vertices, triangles, projection, size, 1)
            several, read_several = prepare_ours(vertices, triangles, projection, size, options.threads)
            times = alternate(one, several, options.rounds)
            if not np.array_equal(read_one().view(np.int32), read_several().view(np.int32)):
                sys.exit(f"{count} triangles into {size}²: the picture depends on the number of threads")
            table.add_row(f"{count:,}", f"{size}²", f"{times[0]:.2f}", f"{times[1]:.2f}", f"{times[2]:.2f}")
        console.print(table)


if __name__ == "__main__":
    main()
