"""VTK's own formats, through pyvista; imported in a process of its own only (:mod:`.isolated`).

Volume grids give their outer surface, blocks are merged. VTK reports damage on its error stream and goes on, so
whoever calls :func:`read` looks there.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pyvista
from numpy.typing import NDArray
from vtkmodules.vtkFiltersGeometry import vtkDataSetSurfaceFilter

from shadowbench.errors import SceneError

from .polygons import Polygons, merged


def read(path: Path) -> Polygons:
    """Read a .vtk, .vtp, .vtu, .vts, .vtr or .vtm file."""
    parts = [_surface(part, path) for part in _datasets(pyvista.read(path))]
    if not parts:
        raise SceneError(f"{path}: has no mesh in it")
    return merged(parts)


def _datasets(read: Any) -> list[Any]:
    if isinstance(read, pyvista.MultiBlock):
        return [dataset for block in read if block is not None for dataset in _datasets(block)]
    return [read] if isinstance(read, pyvista.DataSet) else []


def _surface(dataset: Any, path: Path) -> Polygons:
    if isinstance(dataset, pyvista.UnstructuredGrid):
        _require_indices(_connectivity(dataset.GetCells()), dataset.n_points, path)
    if not isinstance(dataset, pyvista.PolyData):
        dataset = _outer_surface(dataset)
    for cells in (dataset.GetPolys(), dataset.GetStrips()):
        _require_indices(_connectivity(cells), dataset.n_points, path)
    return _polygons(dataset.triangulate() if dataset.n_strips else dataset)


def _outer_surface(dataset: Any) -> Any:
    # not pyvista's extract_surface, whose default algorithm differs between versions
    surface = vtkDataSetSurfaceFilter()
    surface.SetInputData(dataset)
    surface.Update()
    return pyvista.wrap(surface.GetOutput())


def _polygons(dataset: Any) -> Polygons:
    cells = dataset.GetPolys()
    offsets = pyvista.convert_array(cells.GetOffsetsArray()).astype(np.int64)
    return Polygons(np.asarray(dataset.points), np.diff(offsets), _connectivity(cells))


def _connectivity(cells: Any) -> NDArray[np.int64]:
    corners: NDArray[np.int64] = pyvista.convert_array(cells.GetConnectivityArray()).astype(np.int64)
    return corners


def _require_indices(corners: NDArray[np.int64], point_count: int, path: Path) -> None:
    """VTK's filters trust indices; these are checked before one runs."""
    if len(corners) and not (corners.min() >= 0 and corners.max() < point_count):
        worst = int(corners.max() if corners.max() >= point_count else corners.min())
        raise SceneError(f"{path}: a cell names point {worst}, but there are {point_count}; export the mesh again")
