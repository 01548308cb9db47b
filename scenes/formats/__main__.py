"""The child of :mod:`shadowbench.scenes.formats.isolated`: reads one file, writes polygons or an error's text."""

from __future__ import annotations

import importlib
import sys
from pathlib import Path

import numpy as np

from shadowbench.errors import SceneError

from .isolated import ERROR_FILE, POLYGONS_FILE


def main(reader: str, path: str, folder: str) -> None:
    """Read ``path`` with the module ``reader`` of this package; write the result into ``folder``."""
    try:
        polygons = importlib.import_module(f"{__package__}.{reader}").read(Path(path))
    except SceneError as error:
        (Path(folder) / ERROR_FILE).write_text(str(error), encoding="utf-8")
        return
    np.savez(
        Path(folder) / POLYGONS_FILE,
        vertices=polygons.vertices,
        corner_counts=polygons.corner_counts,
        corners=polygons.corners,
        up=np.array(polygons.up or ""),
        notes=np.array(polygons.notes, dtype=np.str_),
    )


if __name__ == "__main__":
    main(*sys.argv[1:])
