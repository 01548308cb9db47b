"""Trees: exactly the triangles asked for, rooted, of their height, and as shady whatever their detail."""

from __future__ import annotations

import numpy as np
import pytest
from scene_geometry import areas

from shadowbench.scenes.trees import LEAF_AREA, LEAST_TRIANGLES, WOOD_SHARE, tree
from shadowbench.scenes.uniform_draws import UniformDraws

COUNTS = [LEAST_TRIANGLES, 1001, 2500, 9999, 36_000, 100_001, 360_000]


@pytest.mark.parametrize("count", COUNTS)
def test_wood_and_leaves_together_are_exactly_as_many_triangles_as_asked_for(count: int) -> None:
    wood, leaves = tree(count, UniformDraws(1), 9.0)
    assert wood.triangle_count + leaves.triangle_count == count
    assert 0.1 * count < wood.triangle_count <= WOOD_SHARE * count
    for shape in (wood, leaves):
        points = shape.points.astype(np.float32)
        assert areas(points[shape.triangles]).min() > 0.0
        assert set(shape.triangles.reshape(-1).tolist()) == set(range(len(points))), "no point is left over"


@pytest.mark.parametrize("count", COUNTS)
@pytest.mark.parametrize("seed", [1, 2])
def test_a_tree_stands_in_its_place_and_has_its_height(count: int, seed: int) -> None:
    wood, leaves = tree(count, UniformDraws(seed), 9.0, sink=0.3)
    assert wood.points[:, 1].min() == pytest.approx(-0.3)
    assert leaves.points[:, 1].max() == pytest.approx(9.0)
    foot = wood.points[wood.points[:, 1] < 0.0]
    assert np.abs(foot[:, [0, 2]]).max() < 0.6
    np.testing.assert_allclose(foot[:, [0, 2]].mean(axis=0), 0.0, atol=0.01)
    # the crown is above head height, wider than the trunk, and not lopsided out of all proportion
    assert leaves.points[:, 1].min() > 1.0
    reach = np.abs(leaves.points[:, [0, 2]])
    assert 2.0 < reach.max() < 7.0


def test_leaves_have_the_same_area_whatever_their_number() -> None:
    for count in COUNTS:
        _, leaves = tree(count, UniformDraws(3), 1.0)
        # folding loses a little, the spread of sizes adds a little, and crowns shrink to the height asked for
        assert areas(leaves.points[leaves.triangles]).sum() == pytest.approx(LEAF_AREA, rel=0.35)


def test_the_wood_is_one_piece() -> None:
    """Each branch begins inside another: its first ring is nearer to the rest of the wood than the tree is thick."""
    wood, _ = tree(36_000, UniformDraws(1), 8.0)
    parts = _connected(wood.triangles, len(wood.points))
    first = np.array([points[0] for points in parts])
    starts = wood.points[first]
    order = np.argsort(first)
    for k in order[1:40]:
        others = np.delete(wood.points, parts[k], axis=0)
        assert np.sqrt(((others - starts[k]) ** 2).sum(axis=1).min()) < 0.45


def _connected(triangles: np.ndarray, point_count: int) -> list[np.ndarray]:
    """Points of each connected piece, by propagating the smallest index."""
    label = np.arange(point_count)
    while True:
        smallest = label[triangles].min(axis=1)
        after = label.copy()
        for corner in range(3):
            np.minimum.at(after, triangles[:, corner], smallest)
        after = after[after]
        if (after == label).all():
            break
        label = after
    return [np.flatnonzero(label == root) for root in np.unique(label)]


def test_another_seed_grows_another_tree() -> None:
    first, again, other = (tree(5000, UniformDraws(seed), 8.0)[1].points for seed in (1, 1, 2))
    assert (first == again).all()
    assert first.shape != other.shape or (first != other).any()
