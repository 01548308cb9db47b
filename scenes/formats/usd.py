"""USD, through usd-core: every visible polygon mesh of the stage, in its place.

Subdivision surfaces are drawn as their control cages; skins and instancers are not expanded.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import Tf, Usd, UsdGeom

from shadowbench.errors import SceneError

from .polygons import Polygons, merged

_REMEDY = "check it with usdchecker, or export it again"


def read(path: Path) -> Polygons:
    """Read a .usd, .usda, .usdc or .usdz file.

    Raises:
        SceneError: Not USD, a layer that it needs is missing, or no mesh.
    """
    try:
        stage = Usd.Stage.Open(str(path))
    except Tf.ErrorException:
        raise SceneError(f"{path}: is not a readable USD file; {_REMEDY}") from None
    broken = [str(error) for error in stage.GetCompositionErrors()]
    if broken:
        raise SceneError(f"{path}: {' '.join(broken[0].split())[:160]}; {_REMEDY}")
    parts: list[Polygons] = []
    others = 0
    for prim in Usd.PrimRange.Stage(stage, Usd.TraverseInstanceProxies()):
        if prim.IsA(UsdGeom.Mesh) and _is_shown(prim):
            parts.append(_mesh(UsdGeom.Mesh(prim), path))
        others += prim.IsA(UsdGeom.Gprim) and not prim.IsA(UsdGeom.Mesh)
    if not parts:
        what = f"; its {others} other shapes (spheres, cubes, curves, ...) are not read" if others else ""
        raise SceneError(f"{path}: has no visible mesh{what}")
    whole = merged(parts)
    notes = (f"{path}: {others} shapes that are no meshes were left out",) if others else ()
    up = "z" if UsdGeom.GetStageUpAxis(stage) == UsdGeom.Tokens.z else "y"
    return Polygons(whole.vertices, whole.corner_counts, whole.corners, up, notes)


def _is_shown(prim: Any) -> bool:
    image = UsdGeom.Imageable(prim)
    purposes = (UsdGeom.Tokens.default_, UsdGeom.Tokens.render)
    return image.ComputeVisibility() != UsdGeom.Tokens.invisible and image.ComputePurpose() in purposes


def _mesh(mesh: Any, path: Path) -> Polygons:
    time = Usd.TimeCode.EarliestTime()
    counts = _integers(mesh.GetFaceVertexCountsAttr().Get(time))
    corners = _integers(mesh.GetFaceVertexIndicesAttr().Get(time))
    if counts.min(initial=0) < 0 or counts.sum() != len(corners):
        raise SceneError(
            f"{path}: mesh {mesh.GetPath()} promises {int(counts.sum())} corners but has {len(corners)}; {_REMEDY}"
        )
    matrix = np.array(mesh.ComputeLocalToWorldTransform(time))  # row vectors: p' = p M
    points = np.array(mesh.GetPointsAttr().Get(time) or np.zeros((0, 3)), np.float64).reshape(-1, 3)
    x, y, z = points.T
    placed = np.stack([matrix[0, k] * x + matrix[1, k] * y + matrix[2, k] * z + matrix[3, k] for k in range(3)], axis=1)
    is_left_handed = mesh.GetOrientationAttr().Get(time) == UsdGeom.Tokens.leftHanded
    if is_left_handed != (_determinant(matrix) < 0.0):  # either alone turns the faces inside out
        corners = _reversed(counts, corners)
    return Polygons(placed, counts, corners)


def _integers(values: Any) -> NDArray[np.int64]:
    return np.array([] if values is None else values, np.int64)


def _reversed(counts: NDArray[np.int64], corners: NDArray[np.int64]) -> NDArray[np.int64]:
    """Each polygon's corners in the opposite order."""
    ends = np.cumsum(counts)
    first_and_last = np.repeat(ends - counts + ends - 1, counts)
    return corners[first_and_last - np.arange(len(corners))]


def _determinant(matrix: NDArray[np.float64]) -> float:
    (a, b, c), (d, e, f), (g, h, i) = matrix[:3, :3].tolist()
    return float(a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g))
