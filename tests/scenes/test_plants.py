"""Leaves, blades and bushes: their sizes, where they are attached, and exact counts."""

from __future__ import annotations

import numpy as np
import pytest
from scene_geometry import areas

from shadowbench.scenes.plants import (
    LEAF_WIDTH,
    Bush,
    along,
    blades,
    bush_stems,
    bushes,
    directions,
    leaf_length,
    leaves,
    tufts,
)
from shadowbench.scenes.uniform_draws import UniformDraws


def test_directions_are_unit_and_point_everywhere() -> None:
    found = directions(UniformDraws(1), 20_000)
    np.testing.assert_allclose(np.linalg.norm(found, axis=1), 1.0)
    np.testing.assert_allclose(found.mean(axis=0), 0.0, atol=0.02)
    np.testing.assert_allclose((found**2).mean(axis=0), 1.0 / 3.0, atol=0.01)


def test_a_leaf_goes_from_its_base_to_its_tip_and_faces_as_asked() -> None:
    base, tip = np.array([[1.0, 2.0, 3.0]]), np.array([[0.0, 0.0, 1.0]])
    leaf = leaves(base, tip, np.array([[0.0, 1.0, 0.2]]), np.array([2.0]))
    assert leaf.triangle_count == 2
    assert leaf.points[0].tolist() == [1.0, 2.0, 3.0]
    assert leaf.points[2].tolist() == pytest.approx([1.0, 2.0, 5.0])
    corners = leaf.points[leaf.triangles]
    assert (np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, 1] > 0.0).all()
    flat = 0.5 * 2.0 * 2.0 * LEAF_WIDTH
    assert flat < areas(corners).sum() < 1.15 * flat


@pytest.mark.parametrize("count", [1, 10, 1000])
def test_leaves_of_the_given_length_have_the_given_area_when_flat(count: int) -> None:
    length = leaf_length(count, 3.0)
    assert count * 0.5 * length * length * LEAF_WIDTH == pytest.approx(3.0)


def test_a_blade_of_grass_stands_on_its_root_and_leans() -> None:
    grass = blades(np.zeros((1, 3)), np.array([[0.3, 0.0, 0.0]]), np.array([1.0]), 0.02)
    assert grass.triangle_count == 3
    assert grass.points[:2, 1].tolist() == [0.0, 0.0]
    assert np.linalg.norm(grass.points[1] - grass.points[0]) == pytest.approx(0.02)
    assert grass.points[4].tolist() == pytest.approx([0.3, 1.0, 0.0])
    assert areas(grass.points[grass.triangles]).min() > 0.0


@pytest.mark.parametrize("count", [3, 4, 5, 1000])
def test_tufts_have_exactly_the_triangles_asked_for(count: int) -> None:
    centres = np.array([(0.0, 0.0), (5.0, 1.0)])
    shape = tufts(UniformDraws(1), count, centres, 0.1, 0.3, 0.01)
    assert shape.triangle_count == count
    assert shape.points[:, 1].min() == 0.0
    roots = shape.points[shape.points[:, 1] == 0.0][:, [0, 2]]
    nearest = np.linalg.norm(roots[:, None] - centres, axis=2).min(axis=1)
    assert nearest.max() < 0.12


THREE = (Bush(0.0, 0.0, 0.0, 0.5, 1.0), Bush(4.0, 1.0, 0.0, 0.3, 0.4), Bush(-4.0, 0.0, 2.0, 1.0, 2.0))


@pytest.mark.parametrize("count", [100, 101, 5000])
def test_bushes_share_the_triangles_by_size_and_stay_in_their_bounds(count: int) -> None:
    shape = bushes(UniformDraws(1), count, THREE, 5.0)
    assert shape.triangle_count == count
    middle = shape.points[shape.triangles].mean(axis=1)
    nearest = np.linalg.norm(middle[:, None, [0, 2]] - [(b.x, b.z) for b in THREE], axis=2).argmin(axis=1)
    share = np.bincount(nearest) / count
    outline = np.array([b.outline for b in THREE])
    np.testing.assert_allclose(share, outline / outline.sum(), atol=0.03)
    for k, bush in enumerate(THREE):
        leaf = leaf_length(max(1, round(share[k] * count / 2)), 5.0 * bush.outline)
        own = middle[nearest == k]
        assert own[:, 1].min() > bush.y - 0.2 * leaf
        assert own[:, 1].max() < bush.y + bush.height + 2.0 * leaf


def test_stems_begin_where_their_bush_stands() -> None:
    stems = bush_stems(UniformDraws(1), THREE)
    assert stems.triangle_count == 162 * len(THREE)
    rings = stems.points.reshape(len(THREE), 9, 4, 3, 3)
    for k, bush in enumerate(THREE):
        np.testing.assert_allclose(rings[k, :, 0].mean(axis=1), np.tile([bush.x, bush.y, bush.z], (9, 1)), atol=1e-12)
        assert (rings[k, :, -1, :, 1] > bush.y).all()


def test_points_along_edges_lie_on_them_in_proportion_to_their_lengths() -> None:
    edges = [(0.0, 0.0, 3.0, 0.0), (10.0, 1.0, 10.0, 2.0)]
    found = along(UniformDraws(1), 4000, edges)
    first = found[found[:, 0] < 5.0]
    second = found[found[:, 0] > 5.0]
    assert (first[:, 1] == 0.0).all()
    assert (second[:, 0] == 10.0).all()
    assert len(first) / 4000 == pytest.approx(0.75, abs=0.03)
    assert 1.0 <= second[:, 1].min() < second[:, 1].max() <= 2.0
