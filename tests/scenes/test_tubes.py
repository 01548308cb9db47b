"""Tubes: round their paths, facing out, without twist."""

from __future__ import annotations

import math

import numpy as np
import pytest

from shadowbench.scenes.tubes import tangents, tubes
from shadowbench.scenes.vectors import across, cross, dot, turned, unit


def _helix(count: int) -> np.ndarray:
    angle = np.linspace(0.0, 4.0 * math.pi, count)
    return np.stack([np.cos(angle), 0.2 * angle, np.sin(angle)], axis=1)


def test_a_tubes_points_lie_at_their_radius_round_the_path_and_across_it() -> None:
    path = np.stack([_helix(60), 2.0 + _helix(60)])
    radius = np.linspace(0.1, 0.05, 60)
    shape = tubes(path, radius, 7)
    rings = shape.points.reshape(2, 60, 7, 3)
    offset = rings - path[:, :, None]
    np.testing.assert_allclose(np.linalg.norm(offset, axis=3), np.broadcast_to(radius[:, None], (2, 60, 7)))
    np.testing.assert_allclose((offset * tangents(path)[:, :, None]).sum(axis=3), 0.0, atol=1e-12)
    np.testing.assert_allclose(offset.mean(axis=2), 0.0, atol=1e-12)
    # from ring to ring no point moves farther than the path bends and tapers
    assert (
        np.linalg.norm(np.diff(rings, axis=1), axis=3).max() < 1.3 * np.linalg.norm(np.diff(path, axis=1), axis=2).max()
    )


@pytest.mark.parametrize("direction", [(0, 1, 0), (0, -1, 0), (1, 0, 0), (0.3, 0.9, -0.2)])
def test_tubes_face_out_whichever_way_they_run(direction: tuple[float, float, float]) -> None:
    along = np.asarray(direction, float) / np.linalg.norm(direction)
    shape = tubes([[np.zeros(3), along, 3.0 * along]], 0.2, 5)
    assert shape.triangle_count == 2 * 5 * 2
    corners = shape.points[shape.triangles]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    middle = corners.mean(axis=1)
    assert ((middle - (middle @ along)[:, None] * along) * normal).sum(axis=1).min() > 0.0


def test_tangents_of_a_circle_are_at_right_angles_to_its_radii() -> None:
    angle = np.linspace(0.0, 2.0, 41)
    circle = np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=1)
    along = tangents(circle)
    np.testing.assert_allclose((along * circle).sum(axis=1)[1:-1], 0.0, atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(along, axis=1), 1.0)


def test_vectors_agree_with_numpy() -> None:
    draw = np.random.default_rng(5)
    a, b = draw.normal(size=(2, 50, 3))
    np.testing.assert_allclose(dot(a, b), (a * b).sum(axis=1))
    np.testing.assert_allclose(cross(a, b), np.cross(a, b))
    u = unit(np.concatenate([a, [[0, 1, 0], [0, -1, 0], [1, 0, 0]]]))
    np.testing.assert_allclose(np.linalg.norm(u, axis=1), 1.0)
    side = across(u)
    np.testing.assert_allclose(np.linalg.norm(side, axis=1), 1.0)
    np.testing.assert_allclose((side * u).sum(axis=1), 0.0, atol=1e-12)
    angle = draw.uniform(-180.0, 180.0, len(u))
    np.testing.assert_allclose((turned(u, side, angle) * u).sum(axis=1), np.cos(np.radians(angle)), atol=1e-12)
