"""Shapes: closed, facing out, of the volume that geometry gives them."""

from __future__ import annotations

import math

import numpy as np
import pytest
from mesh_files import is_closed, signed_volume
from scene_geometry import areas

from shadowbench.scenes.masonry import brick_facing, paving
from shadowbench.scenes.shapes import (
    Shape,
    bars,
    boxes,
    cylinder,
    joined,
    prism,
    rectangle,
    revolved,
    sheet,
    sphere,
    wall,
)
from shadowbench.scenes.uniform_draws import UniformDraws

HEXAGON = [(2.0, 0.0), (1.0, 1.5), (-1.0, 1.5), (-2.0, 0.0), (-1.0, -1.5), (1.0, -1.5)]


def _ring(sides: int) -> float:
    """Area of a regular polygon of circumradius 1."""
    return sides / 2.0 * math.sin(2.0 * math.pi / sides)


@pytest.mark.parametrize(
    ("shape", "volume", "triangles"),
    [
        (boxes((1, 2, 3), (2, 4, 6)), 6.0, 12),
        (bars((0, 0, 0), (1, 2, 2), 0.5, 0.25), 3.0 * 0.125, 12),
        (bars((0, 0, 0), (0, -2, 0), 0.5, 0.25, up=(0, 0, 1)), 0.25, 12),
        (prism(HEXAGON, -1.0, 2.0), 3.0 * 9.0, 20),
        (cylinder(0.5, -1.0, 1.0, 16), 2.0 * 0.25 * _ring(16), 64),
        (revolved([(0, 0), (1, 0), (0, 2)], 8), 2.0 / 3.0 * _ring(8), 16),
        # a cup: a cylinder less a cone bored into it
        (revolved([(0, 0), (1, 0), (1, 2), (0, 1)], 12), (2.0 - 1.0 / 3.0) * _ring(12), 48),
    ],
)
def test_solids_are_closed_and_have_their_volume(shape: Shape, volume: float, triangles: int) -> None:
    assert shape.triangle_count == triangles
    assert is_closed(shape.triangles)
    assert signed_volume(shape.points, shape.triangles) == pytest.approx(volume)


def test_a_sphere_is_closed_and_its_points_lie_on_it() -> None:
    ball = sphere(2.0, 48, 24)
    assert ball.triangle_count == 2 * 48 * 23
    assert is_closed(ball.triangles)
    np.testing.assert_allclose(np.linalg.norm(ball.points, axis=1), 2.0, rtol=1e-15)
    assert signed_volume(ball.points, ball.triangles) == pytest.approx(4.0 / 3.0 * math.pi * 8.0, rel=0.01)


def test_an_open_surface_of_revolution_faces_away_from_its_axis() -> None:
    tube = revolved([(1.0, 0.0), (2.0, 1.0)], 9)
    corners = tube.points[tube.triangles]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    outwards = corners.mean(axis=1) * [1.0, 0.0, 1.0]
    assert ((normal * outwards).sum(axis=1) > 0.0).all()
    assert (normal[:, 1] < 0.0).all(), "it widens upwards, so its outside looks down"


def test_many_boxes_are_as_many_single_ones() -> None:
    low, high = np.array([(0, 0, 0), (2, 0, 1)]), np.array([(1, 1, 1), (3, 2, 2)])
    together = boxes(low, high)
    single = joined(boxes(a, b) for a, b in zip(low, high, strict=True))
    assert (together.points == single.points).all()
    assert (together.triangles == single.triangles).all()


def test_a_bar_lies_where_its_ends_say_with_its_thickness_along_up() -> None:
    bar = bars((1.0, 1.0, 0.0), (5.0, 1.0, 0.0), 0.6, 0.2)
    assert bar.points.min(axis=0).tolist() == pytest.approx([1.0, 0.9, -0.3])
    assert bar.points.max(axis=0).tolist() == pytest.approx([5.0, 1.1, 0.3])


def test_shapes_are_scaled_turned_and_moved() -> None:
    box = boxes((0, 0, 0), (1, 1, 1)).scaled(2.0, 1.0, 1.0).turned((0, 1, 0), 90.0).moved(10.0, 0.0, 0.0)
    assert box.points.min(axis=0).tolist() == [10.0, 0.0, -2.0]
    assert box.points.max(axis=0).tolist() == [11.0, 1.0, 0.0]
    assert signed_volume(box.points, box.triangles) == 2.0


def test_the_first_triangles_keep_the_points_they_need() -> None:
    two = joined([boxes((0, 0, 0), (1, 1, 1)), boxes((5, 5, 5), (6, 6, 6))])
    assert len(two.first(12).points) == 8
    assert len(two.first(13).points) > 8
    assert two.first(13).triangle_count == 13


def test_sheets_and_rectangles_face_up() -> None:
    x, z = np.meshgrid(np.arange(4.0), np.arange(3.0))
    for shape, area in ((sheet(np.stack([x, 0.0 * x, z], axis=2)), 6.0), (rectangle((0, 3), (0, 2)), 6.0)):
        corners = shape.points[shape.triangles]
        assert (np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, 1] > 0.0).all()
        assert areas(corners).sum() == pytest.approx(area)


def test_a_wall_has_the_volume_that_its_openings_leave() -> None:
    openings = [(1.0, 2.0, 0.5, 1.5), (1.0, 2.0, 2.0, 2.5), (3.0, 4.0, 0.0, 2.0)]
    shape = wall((0.0, 5.0), 3.0, (-0.5, 0.0), openings)
    assert signed_volume(shape.points, shape.triangles) == pytest.approx(0.5 * (15.0 - 1.0 - 0.5 - 2.0))
    assert shape.points.min(axis=0).tolist() == [0.0, 0.0, -0.5]
    assert shape.points.max(axis=0).tolist() == [5.0, 3.0, 0.0]
    for x0, x1, y0, y1 in openings:
        middle = np.array([(x0 + x1) / 2.0, (y0 + y1) / 2.0])
        low, high = shape.points[0::8, :2], shape.points[7::8, :2]
        assert not ((low < middle) & (middle < high)).all(axis=1).any()


def test_paving_covers_its_ground_but_for_the_joints_and_no_stone_is_a_sliver() -> None:
    stones = paving(UniformDraws(1), (0.0, 5.3), (1.0, 3.0), (0.5, 0.4), 0.02, 0.1)
    assert len(stones) == 3
    size = np.concatenate([s.points[7::8] - s.points[0::8] for s in stones])
    assert (size[:, 0] >= 0.5 / 4.0 - 0.03).all()
    assert size[:, 0].max() <= 0.75
    assert np.allclose(size[:, 1:], [0.1, 0.38])
    whole = ((size[:, 0] + 0.02) * (size[:, 2] + 0.02)).sum()
    assert whole == pytest.approx(5.3 * 2.0)


def test_bricks_face_forward_and_rise_from_the_ground() -> None:
    bricks = joined(brick_facing(UniformDraws(1), 3.0, 1.0, (0.25, 0.1), 0.01, 0.02))
    low, high = bricks.points.min(axis=0), bricks.points.max(axis=0)
    np.testing.assert_allclose(low, [0.005, 0.005, 0.0], atol=1e-12)
    np.testing.assert_allclose(high, [2.995, 0.995, 0.02], atol=1e-12)
    assert signed_volume(bricks.points, bricks.triangles) > 0.0
