"""From polygons to one clean mesh: which way is up, where it stands, what is dropped."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from mesh_files import TRIANGLES, VERTICES, corners, signed_volume

from shadowbench.errors import SceneError
from shadowbench.scenes.formats.polygons import Polygons, of_triangles
from shadowbench.scenes.standing import standing_mesh

FILE = Path("solid.ply")


def test_the_mesh_stands_on_the_origin() -> None:
    mesh, notes = standing_mesh(of_triangles(VERTICES, TRIANGLES), FILE)
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    assert low.tolist() == [-2.0, 0.0, -0.5]
    assert high.tolist() == [2.0, 6.0, 0.5]
    assert mesh.vertices.dtype == np.float32
    assert mesh.name == "solid"
    assert notes == ()


@pytest.mark.parametrize(("up", "extent"), [("x", [6, 4, 1]), ("y", [4, 6, 1]), ("z", [4, 1, 6])])
def test_the_upward_axis_becomes_y_by_a_rotation(up: str, extent: list[float]) -> None:
    mesh, _ = standing_mesh(of_triangles(VERTICES, TRIANGLES), FILE, up=up)
    assert np.ptp(mesh.vertices, axis=0).tolist() == extent
    height = VERTICES[:, "xyz".index(up)]
    np.testing.assert_array_equal(mesh.vertices[:, 1], height - height.min())
    assert signed_volume(mesh.vertices, mesh.triangles) == pytest.approx(signed_volume(VERTICES, TRIANGLES))


def test_the_files_own_upward_axis_counts_unless_another_is_asked_for() -> None:
    soup = of_triangles(VERTICES, TRIANGLES)
    polygons = Polygons(soup.vertices, soup.corner_counts, soup.corners, up="z")
    assert np.ptp(standing_mesh(polygons, FILE)[0].vertices[:, 1]) == 1.0
    assert np.ptp(standing_mesh(polygons, FILE, up="y")[0].vertices[:, 1]) == 6.0


def test_a_mesh_a_million_units_away_keeps_its_shape() -> None:
    near, _ = standing_mesh(of_triangles(VERTICES, TRIANGLES), FILE)
    far, _ = standing_mesh(of_triangles(VERTICES + np.array([1e6, -3e6, 2e6]), TRIANGLES), FILE)
    np.testing.assert_array_equal(far.vertices, near.vertices)


@pytest.mark.parametrize("power", [60, -60])
def test_a_huge_or_tiny_mesh_is_scaled_by_a_power_of_two_and_says_so(power: int) -> None:
    near, _ = standing_mesh(of_triangles(VERTICES, TRIANGLES), FILE)
    mesh, notes = standing_mesh(of_triangles(VERTICES * 2.0**power, TRIANGLES), FILE)
    np.testing.assert_array_equal(mesh.vertices * 8.0, near.vertices)
    assert len(notes) == 1
    assert "scaled" in notes[0]


def test_degenerate_triangles_are_dropped_and_counted() -> None:
    vertices = np.vstack([VERTICES, [[1e3, 1e3, 1e3]]])
    extra = np.array([(0, 0, 1), (5, 5, 5), (2, 1, 1)])
    mesh, notes = standing_mesh(of_triangles(vertices, np.concatenate([TRIANGLES, extra])), FILE)
    clean, _ = standing_mesh(of_triangles(VERTICES, TRIANGLES), FILE)
    # the far vertex, which only a dropped triangle used, does not move the mesh either
    np.testing.assert_array_equal(corners(mesh.vertices, mesh.triangles), corners(clean.vertices, clean.triangles))
    assert notes == ("solid.ply: 3 of 9 triangles have no area and were left out",)


def test_triangles_that_vanish_in_float32_are_dropped_too() -> None:
    vertices = np.vstack([VERTICES, VERTICES[0] + [1e-12, 0, 0], VERTICES[0] + [0, 1e-12, 0]])
    mesh, notes = standing_mesh(of_triangles(vertices, np.concatenate([TRIANGLES, [(0, 5, 6)]])), FILE)
    assert mesh.triangle_count == len(TRIANGLES)
    assert "1 of 7" in notes[0]


def test_a_mesh_is_placed_by_the_triangles_that_are_left() -> None:
    # a needle a thousand units long and 1e-30 wide vanishes in float32; it must not decide where the solid stands
    needle = np.array([(0.0, 0.0, 0.0), (1e3, 0.0, 0.0), (0.0, 1e-30, 0.0)])
    vertices = np.vstack([VERTICES, needle + np.array([0.0, 500.0, 0.0])])
    mesh, notes = standing_mesh(of_triangles(vertices, np.concatenate([TRIANGLES, [(5, 6, 7)]])), FILE)
    clean, _ = standing_mesh(of_triangles(VERTICES, TRIANGLES), FILE)
    np.testing.assert_array_equal(corners(mesh.vertices, mesh.triangles), corners(clean.vertices, clean.triangles))
    assert "1 of 7" in notes[0]


@pytest.mark.parametrize("triangles", [[(0, 0, 1), (2, 2, 2)], [(0, 1, 5)]], ids=["repeated corners", "in a line"])
def test_a_mesh_of_nothing_but_degenerate_triangles_is_refused(triangles: list[tuple[int, int, int]]) -> None:
    vertices = np.vstack([VERTICES, (VERTICES[0] + VERTICES[1]) / 2.0])
    with pytest.raises(SceneError, match=r"solid\.ply: none of its \d faces has an area"):
        standing_mesh(of_triangles(vertices, np.array(triangles)), FILE)


def test_notes_of_the_reader_come_first() -> None:
    soup = of_triangles(VERTICES, np.concatenate([TRIANGLES, [(0, 0, 0)]]))
    polygons = Polygons(soup.vertices, soup.corner_counts, soup.corners, notes=("from the reader",))
    assert standing_mesh(polygons, FILE)[1][0] == "from the reader"
