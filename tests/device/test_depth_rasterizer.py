"""The rasteriser against rays through texel centres, against exact counts on closed surfaces, and against itself."""

import math
from typing import Any, NamedTuple

import numpy as np
import pytest
import warp as wp
from numpy.typing import NDArray

from shadowbench.device import depth_rasterizer
from shadowbench.device.depth_rasterizer import DepthRasterizer, FragmentCounter
from shadowbench.device.depth_rasterizer_kernels import filling_kernel
from shadowbench.device.depth_rows import keep_nearest_linear_plain, keep_nearest_perspective_plain
from shadowbench.device.launch import Context, kernel_options

wp.set_module_options(kernel_options(native=True))

Vertices = NDArray[np.float32]
Triangles = NDArray[np.int32]
ULP_BELOW_ONE = 2.0**-24

fill_depth_and_ids_plain = filling_kernel(keep_nearest_linear_plain, keep_nearest_perspective_plain)


class Surface(NamedTuple):
    vertices: Vertices
    triangles: Triangles


# --- surfaces


def icosphere(subdivisions: int, roughness: float = 0.0) -> Surface:
    """A closed sphere of triangles; with roughness, a closed star-shaped surface with many folds in a view."""
    golden = (1.0 + math.sqrt(5.0)) / 2.0
    points = [(s, t * golden, 0.0) for s in (-1.0, 1.0) for t in (-1.0, 1.0)]
    points = [p[k:] + p[:k] for k in range(3) for p in points]
    vertices = np.array(points) / math.hypot(1.0, golden)
    distance = np.linalg.norm(vertices[:, None] - vertices[None], axis=2)
    near = distance < 1.2 * distance[distance > 0.0].min()
    triples = [
        (i, j, k) for i in range(12) for j in range(i) for k in range(j) if near[i, j] and near[j, k] and near[i, k]
    ]
    outwards = [np.linalg.det(vertices[list(t)]) > 0.0 for t in triples]
    triangles = np.array([t if out else t[::-1] for t, out in zip(triples, outwards, strict=True)])
    for _ in range(subdivisions):
        edges = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
        unique, index = np.unique(edges, axis=0, return_inverse=True)
        middle = vertices[unique].sum(axis=1)
        ab, bc, ca = (len(vertices) + index.reshape(-1, 3)).T
        vertices = np.concatenate([vertices, middle / np.linalg.norm(middle, axis=1, keepdims=True)])
        a, b, c = triangles.T
        triangles = np.concatenate([np.stack(t, axis=1) for t in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))])
    radius = np.random.default_rng(5).uniform(1.0 - roughness, 1.0, (len(vertices), 1))
    return Surface((vertices * radius).astype(np.float32), triangles.astype(np.int32))


def tessellated_box(cells: int, size: float = 1.6) -> Surface:
    """A closed box whose six sides are grids; vertices on its edges are welded by position."""
    steps = np.linspace(-size / 2.0, size / 2.0, cells + 1)
    quads = []
    for axis in range(3):
        for side, turn in ((0, 1), (cells, -1)):
            for i in range(cells):
                for j in range(cells):
                    corners = np.full((4, 3), side)
                    corners[:, (axis + 1) % 3] = (i, i, i + 1, i + 1)
                    corners[:, (axis + 2) % 3] = (j, j + 1, j + 1, j)
                    quads.append(corners[::turn])
    unique, index = np.unique(np.array(quads).reshape(-1, 3), axis=0, return_inverse=True)
    a, b, c, d = index.reshape(-1, 4).T
    triangles = np.concatenate([np.stack((a, b, c), axis=1), np.stack((a, c, d), axis=1)])
    return Surface(steps[unique].astype(np.float32), triangles.astype(np.int32))


def triangle_soup(count: int, size: float, seed: int = 3) -> Surface:
    random = np.random.default_rng(seed)
    centres = random.uniform(-1.0, 1.0, (count, 1, 3))
    vertices = (centres + random.uniform(-size, size, (count, 3, 3))).reshape(-1, 3).astype(np.float32)
    return Surface(vertices, np.arange(3 * count, dtype=np.int32).reshape(-1, 3))


CLOSED = {
    "icosphere": icosphere(4),
    "rough sphere": icosphere(4, roughness=0.6),
    "coarse rough sphere": icosphere(1, roughness=0.7),
    "tessellated box": tessellated_box(9),
}


# --- views


def rotation(seed: int) -> NDArray[np.float64]:
    q = np.random.default_rng(seed).normal(size=4)
    w, x, y, z = q / np.linalg.norm(q)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


class View(NamedTuple):
    """A projection with rows (u·w, v·w, depth, w), the near plane's w, and the direction it looks in."""

    projection: NDArray[np.float64]
    near: float | None
    forward: NDArray[np.float64]

    def w(self, vertices: Vertices) -> NDArray[np.float64]:
        return vertices @ self.projection[3, :3] + self.projection[3, 3]

    def eye(self) -> NDArray[np.float64]:
        rows = self.projection[[0, 1, 3]]
        return np.linalg.solve(rows[:, :3], -rows[:, 3])


def parallel_view(axes: NDArray[np.float64], extent: float = 1.9) -> View:
    """Orthographic, ``±extent`` along each of the axes right, down, forward."""
    projection = np.eye(4)
    projection[:3, :3], projection[:3, 3] = axes / (2.0 * extent), 0.5
    return View(projection, None, axes[2])


def central_view(
    axes: NDArray[np.float64], eye: Any, *, near: float = 0.5, far: float = 7.0, tangent: float = 0.6
) -> View:
    """Perspective from ``eye`` along the third of the axes right, down, forward."""
    projection = np.zeros((4, 4))
    projection[0, :3] = axes[2] / 2.0 + axes[0] / (2.0 * tangent)
    projection[1, :3] = axes[2] / 2.0 + axes[1] / (2.0 * tangent)
    projection[2, :3] = axes[2] / (far - near)
    projection[3, :3] = axes[2]
    projection[:, 3] = -projection[:, :3] @ np.asarray(eye)
    projection[2, 3] -= near / (far - near)
    return View(projection, near, axes[2])


def looking_along(forward: Any) -> NDArray[np.float64]:
    """Axes right, down, forward with the world's y upwards."""
    ahead = np.asarray(forward) / np.linalg.norm(forward)
    right = np.cross(ahead, [0.0, 1.0, 0.0])
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(ahead, right), ahead])


def around(seed: int) -> View:
    """A central view of the origin from 3.5 away."""
    axes = rotation(seed)
    return central_view(axes, -3.5 * axes[2])


VIEWS = {
    **{f"parallel {seed}": parallel_view(rotation(seed)) for seed in (11, 12, 13)},
    "parallel along an axis": parallel_view(np.eye(3)[[0, 2, 1]], extent=2.0),
    **{f"central {seed}": around(seed) for seed in (21, 22, 23)},
}
NEAR_VIEWS = {f"through the near plane {seed}": central_view(rotation(seed), (0.1, 0.2, -0.3)) for seed in (24, 25)}
ALL_VIEWS = VIEWS | NEAR_VIEWS


def texel_view(width: int, height: int) -> View:
    """x and y are texels, z is depth."""
    return View(np.diag([1.0 / width, 1.0 / height, 1.0, 1.0]), None, np.array([0.0, 0.0, 1.0]))


# --- running


def on_device(surface: Surface) -> tuple[Any, Any]:
    return (
        wp.array(surface.vertices, dtype=wp.vec3, device="cpu"),
        wp.array(surface.triangles, dtype=wp.int32, device="cpu"),
    )


def draw(
    surface: Surface, view: View, width: int, height: int, *, threads: int = 1, **options: Any
) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
    rasterizer = DepthRasterizer(width, height, Context(threads=threads), keep_ids=True)
    rasterizer.draw(*on_device(surface), view.projection, near=view.near, **options)
    assert rasterizer.ids is not None
    return rasterizer.depth.numpy(), rasterizer.ids.numpy()


def count(surface: Surface, view: View, width: int, height: int, *, threads: int = 1) -> NDArray[np.int32]:
    counter = FragmentCounter(width, height, Context(threads=threads))
    counter.draw(*on_device(surface), view.projection, near=view.near)
    counts: NDArray[np.int32] = counter.counts.numpy()
    return counts


def facing_away(surface: Surface, view: View) -> NDArray[np.bool_]:
    """Which triangles turn their back to the view: the sign of the volume they span with the eye."""
    p = surface.vertices.astype(np.float64)[surface.triangles]
    normal = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
    towards = np.broadcast_to(view.forward, normal.shape) if view.near is None else p[:, 0] - view.eye()
    return np.asarray((normal * towards).sum(axis=1) > 0.0)


def texel_rays(view: View, width: int, height: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Origins and directions of the rays through texel centres, row by row; in a central view w runs along them."""
    u = np.tile((np.arange(width) + 0.5) / width, height)
    v = np.repeat((np.arange(height) + 0.5) / height, width)
    if view.near is None:
        linear, offset = view.projection[:3, :3], view.projection[:3, 3]
        origin = np.linalg.solve(linear, np.stack([u, v, 0.0 * u]) - offset[:, None]).T
        return origin, np.broadcast_to(np.linalg.solve(linear, [0.0, 0.0, 1.0]), origin.shape)
    direction = np.linalg.solve(view.projection[[0, 1, 3], :3], np.stack([u, v, np.ones_like(u)])).T
    return np.broadcast_to(view.eye(), direction.shape), direction


def trace(surface: Surface, view: View, width: int, height: int) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Depths and triangles hit nearest by the rays through texel centres: Möller and Trumbore's test in float64."""
    origin, direction = texel_rays(view, width, height)
    row = view.projection[2]
    depth, ids = np.ones(len(origin)), np.full(len(origin), -1)
    for index, (a, b, c) in enumerate(surface.vertices.astype(np.float64)[surface.triangles]):
        cross = np.cross(direction, c - a)
        other = np.cross(origin - a, b - a)
        with np.errstate(all="ignore"):
            scale = cross @ (b - a)
            r = ((origin - a) * cross).sum(axis=1) / scale
            s = (direction * other).sum(axis=1) / scale
            t = other @ (c - a) / scale
        hit = (r >= 0.0) & (s >= 0.0) & (r + s <= 1.0)
        if view.near is not None:
            hit &= t > view.near
        z = np.maximum((origin + np.where(hit, t, 0.0)[:, None] * direction) @ row[:3] + row[3], 0.0)
        hit &= z < depth
        depth[hit], ids[hit] = z[hit], index
    return depth.reshape(height, width), ids.reshape(height, width)


# --- watertight


@pytest.mark.parametrize("view", VIEWS.values(), ids=VIEWS)
@pytest.mark.parametrize("surface", CLOSED.values(), ids=CLOSED)
def test_a_closed_surface_is_covered_as_often_from_the_front_as_from_the_back(surface: Surface, view: View) -> None:
    away = facing_away(surface, view)
    for width, height in ((211, 197), (32, 40), (9, 7)):
        front = count(Surface(surface.vertices, surface.triangles[~away]), view, width, height)
        back = count(Surface(surface.vertices, surface.triangles[away]), view, width, height)
        assert front.max() >= 1
        assert np.array_equal(front, back)


def test_a_convex_surface_is_covered_once_from_each_side() -> None:
    counts = count(CLOSED["icosphere"], VIEWS["central 21"], 256, 256)
    assert set(np.unique(counts)) == {0, 2}


@pytest.mark.parametrize("seed", range(4))
def test_from_inside_a_closed_box_every_texel_is_covered_once_across_the_near_plane(seed: int) -> None:
    view = central_view(rotation(seed), (0.31, -0.17, 0.23), near=1.0e-3, far=10.0, tangent=1.5)
    box = tessellated_box(3)
    behind = view.w(box.vertices) <= 1.0e-3
    assert 0 < behind.sum() < len(behind)
    assert (count(box, view, 300, 260) == 1).all()


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("diagonal", [[[0, 1, 2], [0, 2, 3]], [[0, 1, 3], [3, 1, 2]]])
def test_the_two_halves_of_a_quadrilateral_share_out_its_texels(seed: int, diagonal: list[list[int]]) -> None:
    random = np.random.default_rng(seed)
    angles = np.sort(random.uniform(0.0, 2.0 * np.pi, 4))
    corners = np.zeros((4, 3), np.float32)
    corners[:, 0], corners[:, 1] = 40.0 + 30.0 * np.cos(angles), 32.0 + 30.0 * np.sin(angles)
    counts = count(Surface(corners, np.array(diagonal, np.int32)), texel_view(80, 64), 80, 64)
    x, y = np.meshgrid(np.arange(80) + 0.5, np.arange(64) + 0.5)
    p = corners.astype(np.float64)
    sides = [
        (p[(k + 1) % 4, 0] - p[k, 0]) * (y - p[k, 1]) - (p[(k + 1) % 4, 1] - p[k, 1]) * (x - p[k, 0]) for k in range(4)
    ]
    assert np.array_equal(counts, np.all(np.array(sides) > 0.0, axis=0).astype(int))


def test_a_fan_around_a_texel_centre_covers_every_texel_of_it_once() -> None:
    random = np.random.default_rng(9)
    rim = random.integers(0, 64, (40, 2)) + 0.5
    rim = rim[np.any(rim != 31.5, axis=1)]
    rim = rim[np.argsort(np.arctan2(rim[:, 1] - 31.5, rim[:, 0] - 31.5))]
    vertices = np.zeros((len(rim) + 1, 3), np.float32)
    vertices[0, :2], vertices[1:, :2] = 31.5, rim
    around = np.arange(len(rim))
    fan = np.stack([0 * around, 1 + around, 1 + (around + 1) % len(rim)], axis=1).astype(np.int32)
    counts = count(Surface(vertices, fan), texel_view(64, 64), 64, 64)
    assert counts[31, 31] == 1
    assert counts.max() == 1


def test_texel_centres_on_a_shared_edge_are_covered_once_whatever_way_the_edge_is_met() -> None:
    # edges between texel centres, through others in between; float64 does not hold their slopes
    random = np.random.default_rng(6)
    for _ in range(300):
        step = random.integers(1, 40, 2) * random.choice([-1, 1], 2)
        step //= math.gcd(*(int(k) for k in step))
        steps = int(random.integers(2, 1 + 900 // np.abs(step).max()))
        corner = [random.integers(0, 1000 - abs(k) * steps) + (k < 0) * abs(k) * steps for k in step]
        on_edge = np.array(corner) + np.arange(steps + 1)[:, None] * step
        ends = on_edge[[0, -1]] + 0.5
        across = np.array([-step[1], step[0]]) * steps
        sides = [ends.mean(axis=0) + random.uniform(-0.9, 0.9) * step * steps + sign * across for sign in (-1, 1)]
        vertices = np.concatenate([np.array([*ends, *sides]), np.full((4, 1), 0.5)], axis=1).astype(np.float32)
        counts = count(
            Surface(vertices, np.array([[0, 1, 2], [1, 0, 3]], np.int32)), texel_view(1000, 1000), 1000, 1000
        )
        x, y = on_edge[1:-1].T
        assert (counts[y, x] == 1).all()
        assert counts.max() == 1


def test_texel_centres_on_a_shared_edge_are_covered_once_where_the_near_plane_cuts_it() -> None:
    # strips of ground whose edges run towards the eye, so that each is seen in one column of texel centres
    size, near = 64, 0.1
    projection = np.array([[1.0, 0, 0, 0], [0, 1, 0, 0], [0, 0, 0.1, 0], [0, 0, 1, 0]])
    column = (np.arange(size) + 0.5) / size
    for back, front in ((2.0**-4, 0.5), (2.0**-5, 2.0), (2.0**-7, 5.0), (2.0**-12, 1.25)):
        row = [np.stack([column * z, 0.05 * np.ones(size), np.full(size, z)], axis=1) for z in (back, front)]
        a, b = np.arange(size - 1), np.arange(1, size)
        for halves in ([(a, b, b + size), (a, b + size, a + size)], [(a, b, a + size), (b, b + size, a + size)]):
            triangles = np.concatenate([np.stack(h, axis=1) for h in halves]).astype(np.int32)
            surface = Surface(np.concatenate(row).astype(np.float32), triangles)
            counts = count(surface, View(projection, near, np.array([0.0, 0.0, 1.0])), size, size)
            seen = slice(math.ceil(0.05 / front * size - 0.5), size // 2)
            assert (counts[seen, :-1] == 1).all()
            assert counts.sum() == counts[seen, :-1].size


@pytest.mark.parametrize("down_right", [True, False])
def test_a_grid_with_vertices_on_texel_centres_covers_its_left_and_top_but_not_its_right_and_bottom(
    *, down_right: bool
) -> None:
    random = np.random.default_rng(2)
    xs, ys = np.unique(random.integers(3, 60, 12)) + 0.5, np.unique(random.integers(4, 50, 9)) + 0.5
    vertices = np.array([(x, y, 0.5) for y in ys for x in xs], np.float32)
    corner = np.arange(len(vertices)).reshape(len(ys), len(xs))
    a, b, c, d = corner[:-1, :-1].ravel(), corner[:-1, 1:].ravel(), corner[1:, 1:].ravel(), corner[1:, :-1].ravel()
    halves = [(a, b, c), (c, d, a)] if down_right else [(a, b, d), (d, b, c)]
    triangles = np.concatenate([np.stack(h, axis=1) for h in halves]).astype(np.int32)
    counts = count(Surface(vertices, triangles), texel_view(64, 56), 64, 56)
    expected = np.zeros((56, 64), int)
    expected[int(ys[0]) : int(ys[-1]), int(xs[0]) : int(xs[-1])] = 1
    assert np.array_equal(counts, expected)


# --- depth and numbers


@pytest.mark.parametrize("view", ALL_VIEWS.values(), ids=ALL_VIEWS)
@pytest.mark.parametrize(("triangles", "size"), [(12, 2.0), (300, 0.2)])
def test_depth_and_numbers_are_those_of_rays_through_the_texel_centres(triangles: int, size: float, view: View) -> None:
    surface = triangle_soup(triangles, size)
    depth, ids = draw(surface, view, 71, 53)
    expected_depth, expected_ids = trace(surface, view, 71, 53)
    assert np.array_equal(ids, expected_ids)
    assert np.abs(depth - expected_depth).max() <= ULP_BELOW_ONE
    assert (depth[ids < 0] == 1.0).all()


def test_a_large_slanted_ground_has_the_depth_of_its_plane_everywhere() -> None:
    ground = Surface(
        np.array([[-50, -1, -50], [50, -1, -50], [50, -1, 50], [-50, -1, 50]], np.float32),
        np.array([[0, 1, 2], [0, 2, 3]], np.int32),
    )
    view = central_view(looking_along((0.3, -0.2, -1.0)), (0.0, 0.5, 0.0), near=0.01, far=60.0, tangent=0.7)
    depth, ids = draw(ground, view, 160, 120)
    expected_depth, expected_ids = trace(ground, view, 160, 120)
    assert np.array_equal(ids >= 0, expected_ids >= 0)
    assert 0.4 < (ids >= 0).mean() < 0.9
    assert np.abs(depth - expected_depth).max() <= ULP_BELOW_ONE


def test_of_equally_near_fragments_the_first_drawn_is_kept() -> None:
    soup = triangle_soup(40, 0.8)
    twice = Surface(soup.vertices, np.concatenate([soup.triangles, soup.triangles]))
    depth, ids = draw(soup, VIEWS["central 22"], 90, 70)
    depth_of_twice, ids_of_twice = draw(twice, VIEWS["central 22"], 90, 70)
    assert np.array_equal(depth, depth_of_twice)
    assert np.array_equal(ids, ids_of_twice)


def test_draws_add_up_and_clearing_empties() -> None:
    soup, view = triangle_soup(60, 0.6), VIEWS["parallel 12"]
    vertices, triangles = on_device(soup)
    depth, ids = draw(soup, view, 64, 48)
    rasterizer = DepthRasterizer(64, 48, Context(), keep_ids=True)
    rasterizer.draw(vertices, triangles[20:].contiguous(), view.projection, near=None, first_triangle=20)
    rasterizer.draw(vertices, triangles[:20].contiguous().flatten(), view.projection, near=None)
    assert rasterizer.ids is not None
    assert np.array_equal(rasterizer.depth.numpy(), depth)
    assert np.array_equal(rasterizer.ids.numpy(), ids)
    rasterizer.clear()
    assert (rasterizer.depth.numpy() == 1.0).all()
    assert (rasterizer.ids.numpy() == -1).all()


def test_a_draw_of_nothing_after_clearing_leaves_the_given_memory_empty() -> None:
    memory = wp.zeros((6, 10), dtype=wp.float32, device="cpu")
    rasterizer = DepthRasterizer(10, 6, Context(), depth=memory)
    nothing = Surface(np.zeros((0, 3), np.float32), np.zeros((0, 3), np.int32))
    rasterizer.draw(*on_device(nothing), np.eye(4), near=None)
    assert (memory.numpy() == 1.0).all()
    assert rasterizer.depth is memory
    assert rasterizer.ids is None


def test_depth_beyond_one_is_dropped_and_depth_before_zero_is_kept_at_zero() -> None:
    corners = np.array([[0, 0, -1.0], [16, 0, -1.0], [16, 8, 2.0], [0, 8, 2.0]], np.float32)
    depth, ids = draw(Surface(corners, np.array([[0, 1, 2], [0, 2, 3]], np.int32)), texel_view(16, 8), 16, 8)
    exact = -1.0 + 3.0 * (np.arange(8) + 0.5) / 8.0
    assert np.allclose(depth, np.clip(exact, 0.0, 1.0)[:, None], atol=ULP_BELOW_ONE)
    assert np.array_equal(ids >= 0, np.broadcast_to((exact < 1.0)[:, None], (8, 16)))


# --- polygon offset


def test_polygon_offset_adds_the_larger_slope_of_a_parallel_view() -> None:
    random = np.random.default_rng(4)
    for _ in range(5):
        dx, dy = random.uniform(-0.008, 0.008, 2)
        corners = np.array([[x, y, 0.5 + dx * (x - 20.0) + dy * (y - 16.0)] for x, y in ((-9, -3), (90, 1), (5, 80))])
        surface = Surface(corners.astype(np.float32), np.array([[0, 1, 2]], np.int32))
        plain, _ = draw(surface, texel_view(40, 32), 40, 32)
        moved, _ = draw(surface, texel_view(40, 32), 40, 32, slope_bias=1.5, constant_bias=0.001)
        inside = (plain < 1.0) & (moved < 1.0)
        assert inside.sum() > 500
        expected = plain.astype(np.float64) + 1.5 * max(abs(dx), abs(dy)) + 0.001
        assert np.abs(moved - expected)[inside].max() < 2.0e-6  # the corners are float32


def test_polygon_offset_follows_the_slope_from_texel_to_texel_in_a_central_view() -> None:
    ground = Surface(
        np.array([[-50, -1, -50], [50, -1, -50], [0, -1, 90]], np.float32), np.array([[0, 1, 2]], np.int32)
    )
    view = central_view(looking_along((0.3, -0.6, -1.0)), (0.0, 0.5, 0.0), near=0.01, far=30.0, tangent=0.4)
    plain, ids = draw(ground, view, 64, 48)
    moved, _ = draw(ground, view, 64, 48, slope_bias=2.0, constant_bias=0.01)
    # the slope at a texel's centre from exact depths a thousandth of a texel to each side
    step, slopes = 1.0e-3, []
    for axis, size in ((0, 64), (1, 48)):
        sides = []
        for shift in (-step / size, step / size):
            shifted = view.projection.copy()
            shifted[axis] += shift * shifted[3]
            sides.append(trace(ground, view._replace(projection=shifted), 64, 48)[0])
        slopes.append(np.abs(sides[1] - sides[0]) / (2.0 * step))
    slope = np.maximum(*slopes)
    assert (ids >= 0).all()
    assert slope.max() > 5.0 * slope.min()
    assert np.allclose(moved, plain + 2.0 * slope + 0.01, rtol=0.0, atol=3.0 * ULP_BELOW_ONE)


# --- the same bits, however it is computed


@pytest.mark.parametrize("name", ["parallel 11", "central 21", "through the near plane 24"])
def test_every_number_of_threads_gives_the_same_bits(name: str) -> None:
    large, small = triangle_soup(20, 1.5), triangle_soup(20_000, 0.03, seed=8)
    soup = Surface(
        np.concatenate([large.vertices, small.vertices]),
        np.concatenate([large.triangles, small.triangles + len(large.vertices)]),
    )
    view = ALL_VIEWS[name]
    depth, ids = draw(soup, view, 333, 217)
    counts = count(soup, view, 333, 217)
    for threads in (2, 3, 7):
        other_depth, other_ids = draw(soup, view, 333, 217, threads=threads)
        assert np.array_equal(depth.view(np.int32), other_depth.view(np.int32))
        assert np.array_equal(ids, other_ids)
        assert np.array_equal(counts, count(soup, view, 333, 217, threads=threads))


@pytest.mark.parametrize("name", ["parallel 11", "central 21", "through the near plane 24"])
@pytest.mark.parametrize("width", [1, 5, 8, 64, 99])
def test_native_rows_give_the_bits_of_their_plain_twins(name: str, width: int, monkeypatch: pytest.MonkeyPatch) -> None:
    soup, view = triangle_soup(30, 1.5), ALL_VIEWS[name]
    biases = {"slope_bias": 1.25, "constant_bias": -0.003}
    depth, ids = draw(soup, view, width, 41, **biases)
    depth_alone = DepthRasterizer(width, 41, Context())
    depth_alone.draw(*on_device(soup), view.projection, near=view.near, **biases)
    monkeypatch.setattr(depth_rasterizer, "fill_depth_and_ids", fill_depth_and_ids_plain)
    plain_depth, plain_ids = draw(soup, view, width, 41, **biases)
    assert np.array_equal(depth.view(np.int32), plain_depth.view(np.int32))
    assert np.array_equal(ids, plain_ids)
    assert np.array_equal(depth_alone.depth.numpy().view(np.int32), depth.view(np.int32))


def test_drawing_in_chunks_gives_the_same_bits(monkeypatch: pytest.MonkeyPatch) -> None:
    soup, view = triangle_soup(700, 0.3), VIEWS["central 23"]
    depth, ids = draw(soup, view, 120, 100)
    monkeypatch.setattr(depth_rasterizer, "_LARGEST_CHUNK", 64)
    chunked_depth, chunked_ids = draw(soup, view, 120, 100, threads=2)
    assert np.array_equal(depth, chunked_depth)
    assert np.array_equal(ids, chunked_ids)


# --- triangles that are hard to draw


def test_triangles_without_area_cover_nothing() -> None:
    vertices = np.array([[3, 4, 0.5], [20, 17, 0.5], [20, 17, 0.5], [37, 30, 0.5], [3.5, 4, 0.5]], np.float32)
    triangles = [[0, 0, 0], [0, 1, 1], [0, 1, 2], [0, 0, 4], [0, 4, 4], [1, 2, 1], [0, 1, 3]]
    counts = count(Surface(vertices, np.array(triangles, np.int32)), texel_view(40, 40), 40, 40)
    assert not counts.any()


def test_a_sliver_keeps_the_depths_of_its_vertices() -> None:
    # seen almost edge-on: a hundredth of a texel wide, its depth running from 0.2 to 0.8 across
    vertices = np.array([[10.495, 2, 0.2], [10.505, 30, 0.8], [10.505, 2, 0.8]], np.float32)
    depth, ids = draw(Surface(vertices, np.array([[0, 1, 2]], np.int32)), texel_view(32, 32), 32, 32)
    assert 0 < (ids == 0).sum() <= 28
    assert ((depth[ids == 0] >= np.float32(0.2)) & (depth[ids == 0] <= np.float32(0.8))).all()


@pytest.mark.parametrize("size", [1.0e4, 1.0e9, 1.0e18, 1.0e30])
def test_a_triangle_far_larger_than_the_window_covers_all_of_it(size: float) -> None:
    vertices = np.array([[-size, -size, 0.25], [3.0 * size, -size, 0.25], [-size, 3.0 * size, 0.25]], np.float32)
    surface = Surface(vertices, np.array([[0, 1, 2]], np.int32))
    depth, ids = draw(surface, texel_view(50, 40), 50, 40)
    assert (ids == 0).all()
    assert (depth == 0.25).all()


@pytest.mark.parametrize("shift", [(100, 0), (-100, 0), (0, 100), (0, -100)])
def test_what_lies_outside_the_window_is_not_drawn(shift: tuple[int, int]) -> None:
    vertices = np.array([[1, 1, 0.5], [39, 2, 0.5], [5, 38, 0.5]], np.float32)
    vertices[:, :2] += shift
    assert not count(Surface(vertices, np.array([[0, 1, 2]], np.int32)), texel_view(40, 40), 40, 40).any()


def test_what_lies_behind_the_near_plane_is_not_drawn() -> None:
    view, sphere = around(21), icosphere(2)
    behind = sphere.vertices + (view.eye() - 4.0 * view.forward).astype(np.float32)
    assert not count(Surface(behind, sphere.triangles), view, 40, 40).any()


def test_a_million_degenerate_triangles_are_drawn_as_nothing() -> None:
    vertices = np.zeros((3, 3), np.float32)
    triangles = np.zeros((1_000_000, 3), np.int32)
    assert not count(Surface(vertices, triangles), texel_view(16, 16), 16, 16, threads=2).any()


@pytest.mark.parametrize(("width", "height"), [(0, 4), (4, 0), (1 << 16, 1 << 15)])
def test_impossible_sizes_are_refused(width: int, height: int) -> None:
    with pytest.raises(ValueError, match="texels"):
        DepthRasterizer(width, height, Context())
    with pytest.raises(ValueError, match="texels"):
        FragmentCounter(width, height, Context())


@pytest.mark.parametrize("near", [0.0, -1.0, math.nan])
def test_a_near_plane_that_is_not_in_front_is_refused(near: float) -> None:
    with pytest.raises(ValueError, match="near plane"):
        draw(CLOSED["tessellated box"], around(21)._replace(near=near), 8, 8)


def test_memory_of_another_shape_is_refused() -> None:
    with pytest.raises(ValueError, match=r"shape \(4, 8\), not \(8, 4\)"):
        DepthRasterizer(8, 4, Context(), depth=wp.zeros((8, 4), dtype=wp.float32, device="cpu"))
