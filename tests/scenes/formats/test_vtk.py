"""VTK's formats: the same triangles from every one, and the outside of volumes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mesh_files import TRIANGLES, VERTICES, corners, is_closed, signed_volume

from shadowbench.errors import SceneError
from shadowbench.scenes.formats import vtk
from shadowbench.scenes.formats.polygons import triangulate

pyvista = pytest.importorskip("pyvista")


def _solid(vertices: Any = VERTICES) -> Any:
    return pyvista.PolyData(np.array(vertices), np.column_stack([np.full(len(TRIANGLES), 3), TRIANGLES]).reshape(-1))


@pytest.mark.parametrize("binary", [True, False], ids=["binary", "text"])
@pytest.mark.parametrize("name", ["solid.vtk", "solid.vtp", "grid.vtu", "grid.vtk"])
def test_triangles_come_out_as_written(tmp_path: Path, name: str, *, binary: bool) -> None:
    solid = _solid()
    if name.startswith("grid"):
        cells = {pyvista.CellType.TRIANGLE: TRIANGLES}
        solid = pyvista.UnstructuredGrid(cells, VERTICES)
    solid.save(tmp_path / name, binary=binary)
    polygons = vtk.read(tmp_path / name)
    np.testing.assert_array_equal(corners(polygons.vertices, triangulate(polygons)), corners(VERTICES, TRIANGLES))
    assert polygons.up is None


def test_double_precision_survives(tmp_path: Path) -> None:
    vertices = VERTICES + 1e6 + 1.0 / 3.0
    _solid(vertices).save(tmp_path / "far.vtp")
    np.testing.assert_array_equal(vtk.read(tmp_path / "far.vtp").vertices, vertices)


def test_blocks_are_merged(tmp_path: Path) -> None:
    blocks = pyvista.MultiBlock([_solid(), None, pyvista.MultiBlock([_solid(VERTICES + 10.0)])])
    blocks.save(tmp_path / "two.vtm")
    polygons = vtk.read(tmp_path / "two.vtm")
    both = np.concatenate([VERTICES, VERTICES + 10.0])
    expected = corners(both, np.concatenate([TRIANGLES, TRIANGLES + len(VERTICES)]))
    np.testing.assert_array_equal(corners(polygons.vertices, triangulate(polygons)), expected)


@pytest.mark.parametrize("name", ["box.vts", "box.vtr", "box.vtu"])
def test_a_volume_gives_its_outside(tmp_path: Path, name: str) -> None:
    grid = pyvista.RectilinearGrid(np.arange(3.0), np.arange(4.0), np.arange(5.0))
    grid = {"vts": grid.cast_to_structured_grid, "vtr": lambda: grid, "vtu": grid.cast_to_unstructured_grid}[
        name[-3:]
    ]()
    grid.save(tmp_path / name)
    polygons = vtk.read(tmp_path / name)
    # the sides of a structured grid share no vertices, but their edges meet
    vertices, welded = np.unique(polygons.vertices, axis=0, return_inverse=True)
    triangles = welded.reshape(-1)[triangulate(polygons)]
    assert is_closed(triangles)
    assert signed_volume(vertices, triangles) == pytest.approx(2.0 * 3.0 * 4.0)


def test_strips_are_cut_into_triangles(tmp_path: Path) -> None:
    pyvista.PolyData(VERTICES, strips=[5, 0, 1, 2, 3, 4]).save(tmp_path / "strip.vtp")
    polygons = vtk.read(tmp_path / "strip.vtp")
    expected = corners(VERTICES, np.array([(0, 1, 2), (1, 3, 2), (2, 3, 4)]))
    np.testing.assert_array_equal(
        np.sort(corners(polygons.vertices, polygons.corners), axis=1), np.sort(expected, axis=1)
    )


def test_a_cell_that_names_a_missing_point_is_refused_before_any_filter_runs(tmp_path: Path) -> None:
    path = tmp_path / "bad.vtk"
    path.write_text(
        "# vtk DataFile Version 3.0\nby hand\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 3 float\n"
        "0 0 0 1 0 0 0 1 0\nCELLS 1 4\n3 0 1 9\nCELL_TYPES 1\n5\n"
    )
    with pytest.raises(SceneError, match=r"bad\.vtk: a cell names point 9, but there are 3"):
        vtk.read(path)
