"""Reading mesh files, strictly.

A benchmark must not draw a damaged mesh, so every reader checks what it reads against what the file promises and ends
in one :class:`~shadowbench.errors.SceneError` that names the file, the place in it and the remedy. PLY, OBJ, STL and
glTF have readers of their own, since the usual ones fill a truncated file with zeros, read past a buffer's end or crash
on a wrong index, and round double precision away. VTK's formats go through pyvista and USD through usd-core, both in a
process of their own (:mod:`~shadowbench.scenes.formats.isolated`). Nothing here knows about lights or cameras.
"""

from __future__ import annotations

from pathlib import Path

from shadowbench.errors import SceneError, did_you_mean

from . import gltf, obj, ply, stl
from .isolated import read_isolated
from .polygons import Polygons

READERS = {
    ".ply": ply.read,
    ".obj": obj.read,
    ".stl": stl.read,
    ".gltf": gltf.read,
    ".glb": gltf.read,
}
ISOLATED_READERS = {
    **dict.fromkeys((".vtk", ".vtp", ".vtu", ".vts", ".vtr", ".vtm"), "vtk"),
    **dict.fromkeys((".usd", ".usda", ".usdc", ".usdz"), "usd"),
}
EXTENSIONS = tuple(sorted([*READERS, *ISOLATED_READERS]))


def read_mesh(path: Path) -> Polygons:
    """Read a mesh file of any known format, by its extension.

    Raises:
        SceneError: No such file, not a mesh file, or a damaged one.
    """
    _require_file(path)
    extension = path.suffix.lower()
    try:
        if extension in READERS:
            return READERS[extension](path)
        return read_isolated(ISOLATED_READERS[extension], path)
    except OSError as error:
        raise SceneError(f"{path}: cannot be read: {error.strerror or error}") from None


def _require_file(path: Path) -> None:
    try:
        if path.is_dir():
            raise SceneError(f"{path}: is a folder; name one mesh file in it ({_listed(path)})")
        if path.is_symlink() and not path.exists():
            raise SceneError(f"{path}: is a link to {path.readlink()}, where there is no file")
        if not path.exists():
            raise SceneError(f"{path}: no such file; {_nearest(path)}")
        if path.suffix.lower() not in EXTENSIONS:
            kind = f"extension '{path.suffix}'" if path.suffix else "a name without an extension"
            raise SceneError(f"{path}: {kind} is not a mesh format read here; known: {', '.join(EXTENSIONS)}")
        if not path.is_file():
            raise SceneError(f"{path}: is a pipe, socket or device, not a file; write it to a file first")
        if path.stat().st_size == 0:
            raise SceneError(f"{path}: the file is empty (0 bytes); export or copy it again")
    except OSError as error:
        raise SceneError(f"{path}: cannot be read: {error.strerror or error}") from None


def _mesh_names(folder: Path) -> list[str]:
    return sorted(p.name for p in folder.iterdir() if p.suffix.lower() in EXTENSIONS)


def _listed(folder: Path) -> str:
    names = _mesh_names(folder)
    return ", ".join(names[:6]) + (", ..." if len(names) > 6 else "") if names else "there is none"


def _nearest(path: Path) -> str:
    if not path.parent.is_dir():
        return f"there is no folder {path.parent} either"
    names = _mesh_names(path.parent)
    return did_you_mean(path.name, names, noun="mesh file") if names else f"{path.parent} holds no mesh file"
