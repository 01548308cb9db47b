"""Polygons to triangles: counts, areas and facing, against the shoelace formula."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from shadowbench.errors import SceneError
from shadowbench.scenes.formats.polygons import (
    Polygons,
    check,
    merged,
    of_triangles,
    triangulate,
    without_degenerate,
)


def _one(points: NDArray[np.float64]) -> Polygons:
    return Polygons(points, np.array([len(points)]), np.arange(len(points)))


def _in_plane(flat: NDArray[np.float64]) -> NDArray[np.float64]:
    """Put 2-D points [n, 2] on a slanted plane whose axes are orthonormal."""
    u, v = np.array([0.48, 0.6, 0.64]), np.array([-0.8, 0.6, 0.0]) * np.array([0.75, 1.0, 1.0])
    v -= u * (u @ v)
    return 10.0 + flat[:, :1] * u + flat[:, 1:] * (v / np.linalg.norm(v))


def _shoelace(flat: NDArray[np.float64]) -> float:
    x, y = flat.T
    return float((x * np.roll(y, -1) - np.roll(x, -1) * y).sum() / 2.0)


def _signed_areas(points: NDArray[np.float64], triangles: NDArray[np.int32]) -> NDArray[np.float64]:
    """Areas of triangles of a plane polygon, positive where they face as the first convex corner does."""
    a, b, c = (points[triangles[:, k]] for k in range(3))
    vectors = np.cross(b - a, c - a) / 2.0
    total = vectors.sum(axis=0)
    return vectors @ (total / np.linalg.norm(total))


@settings(max_examples=150, deadline=None)
@given(radii=st.lists(st.floats(0.05, 3.0), min_size=3, max_size=24), turn=st.floats(0.0, 6.28))
def test_a_star_shaped_polygon_is_covered_once(radii: list[float], turn: float) -> None:
    angles = turn + 2.0 * math.pi * np.arange(len(radii)) / len(radii)
    flat = np.array(radii)[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    points = _in_plane(flat)
    triangles = triangulate(_one(points))
    assert len(triangles) == len(radii) - 2
    areas = _signed_areas(points, triangles)
    # nothing is covered twice: the areas' sizes, not only their sum, add up to the polygon's
    assert np.abs(areas).sum() == pytest.approx(_shoelace(flat), rel=1e-9)
    assert areas.sum() == pytest.approx(_shoelace(flat), rel=1e-9)


@pytest.mark.parametrize("first", range(4))
def test_an_arrowhead_is_cut_at_its_notch_whichever_corner_comes_first(first: int) -> None:
    flat = np.roll(np.array([(0.0, 0.0), (4.0, -2.0), (1.0, 0.0), (4.0, 2.0)]), first, axis=0)
    points = np.column_stack([flat, np.zeros(4)])
    areas = _signed_areas(points, triangulate(_one(points)))
    assert sorted(areas) == pytest.approx([1.0, 1.0])


def test_a_polygon_with_a_hole_on_a_bridge_keeps_its_hole() -> None:
    outer = [(0.0, 0.0), (4.0, 0.0), (4.0, 4.0), (0.0, 4.0), (0.0, 0.0)]
    hole = [(1.0, 1.0), (1.0, 3.0), (3.0, 3.0), (3.0, 1.0), (1.0, 1.0)]
    flat = np.array([*outer, *hole])
    points = np.column_stack([flat, np.zeros(len(flat))])
    areas = _signed_areas(points, triangulate(_one(points)))
    assert areas.min() >= 0.0
    assert areas.sum() == pytest.approx(12.0)


def test_a_corner_in_the_middle_of_an_edge_makes_no_empty_triangle() -> None:
    points = np.array([(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (2.0, 0.0, 0.0), (0.0, 2.0, 0.0)])
    assert _signed_areas(points, triangulate(_one(points))).min() > 0.5


def test_a_polygon_that_crosses_itself_still_gives_its_number_of_triangles() -> None:
    points = np.array([(0.0, 0.0, 0.0), (2.0, 2.0, 0.0), (2.0, 0.0, 0.0), (0.0, 2.0, 0.0), (-1.0, 1.0, 0.0)])
    triangles = triangulate(_one(points))
    assert triangles.shape == (3, 3)
    assert set(triangles.reshape(-1).tolist()) <= set(range(5))


def test_triangles_come_in_the_order_of_their_polygons() -> None:
    square = np.array([(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (1.0, 1.0, 0.0), (0.0, 1.0, 0.0)])
    polygons = Polygons(square, np.array([3, 4, 2, 3]), np.array([0, 1, 2, 0, 1, 2, 3, 0, 1, 1, 2, 3]))
    expected = [(0, 1, 2), (0, 1, 2), (0, 2, 3), (1, 2, 3)]
    assert triangulate(polygons).tolist() == [list(t) for t in expected]


def test_merging_shifts_indices_and_keeps_notes() -> None:
    points = np.arange(9.0).reshape(3, 3)
    one = of_triangles(points, np.array([[0, 1, 2]]))
    other = Polygons(points + 100.0, np.array([3]), np.array([2, 1, 0]), notes=("careful",))
    both = merged([one, other])
    assert both.vertices[both.corners].tolist() == [*points.tolist(), *(points + 100.0)[::-1].tolist()]
    assert both.notes == ("careful",)


@pytest.mark.parametrize(
    ("polygons", "words"),
    [
        (Polygons(np.zeros((4, 3)), np.zeros(0, np.int64), np.zeros(0, np.int64)), ["no faces", "only 4 points"]),
        (Polygons(np.zeros((3, 3)), np.array([3, 3]), np.array([0, 1, 2, 0, 1, 3])), ["face 1", "vertex 3", "0 to 2"]),
        (Polygons(np.zeros((3, 3)), np.array([3]), np.array([0, 1, -1])), ["face 0", "vertex -1"]),
        (Polygons(np.zeros((3, 3)), np.array([3, 3]), np.array([0, 1, 2, 0])), ["promise 6 corners, but have 4"]),
        (Polygons(np.zeros((3, 3)), np.array([5, -2]), np.array([0, 1, 2])), ["a face has -2 corners"]),
        (_one(np.array([(0.0, 0.0, 0.0), (1.0, np.nan, 0.0), (0.0, 1.0, 0.0)])), ["vertex 1", "(1, nan, 0)", "finite"]),
        (_one(np.array([(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1e40, 0.0)])), ["vertex 2", "beyond"]),
    ],
)
def test_what_cannot_be_used_is_named(polygons: Polygons, words: list[str]) -> None:
    with pytest.raises(SceneError) as caught:
        check(polygons, Path("solid.ply"))
    assert str(caught.value).startswith("solid.ply: ")
    assert "\n" not in str(caught.value)
    for word in words:
        assert word in str(caught.value)


def test_triangles_without_area_and_vertices_without_triangles_go() -> None:
    vertices = np.array([(9, 9, 9), (0, 0, 0), (1, 0, 0), (0, 1, 0), (2, 0, 0), (0, 0, 0)], np.float32)
    triangles = np.array([(1, 2, 2), (1, 2, 3), (1, 2, 4), (1, 5, 3)], np.int32)  # repeated, good, in line, coincident
    left, kept = without_degenerate(vertices, triangles)
    assert left.tolist() == [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
    assert left.dtype == np.float32
    assert kept.tolist() == [[0, 1, 2]]


def test_a_sliver_of_one_last_bit_is_kept() -> None:
    vertices = np.array([(0, 0, 0), (1, 0, 0), (0.5, np.nextafter(np.float32(0), np.float32(1)), 0)], np.float32)
    assert len(without_degenerate(vertices, np.array([(0, 1, 2)], np.int32))[1]) == 1
