"""The Stanford bunny: the scanned mesh that every installation has, since Warp ships it among its examples."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from typing import ClassVar

from pydantic import BaseModel

from shadowbench.errors import SceneError
from shadowbench.scene import Scene, ScenePlugin

from .fitting import FitParameters, fitted_scene
from .standing import standing_mesh


class Bunny(ScenePlugin):
    """12,200 triangles, standing on a ground."""

    name = "bunny"
    title = "The Stanford bunny"
    source = "Turk and Levoy 1994, as shipped with NVIDIA Warp"
    Parameters: ClassVar[type[BaseModel]] = FitParameters

    def make(self, parameters: BaseModel) -> Scene:
        """Read the mesh from Warp's assets."""
        assert isinstance(parameters, FitParameters)
        # lazily: the scene can be listed without usd-core
        from .formats import usd

        path = bunny_path()
        if not path.is_file():
            raise SceneError(
                "this version of warp-lang has no Stanford bunny among its assets (warp/examples/assets/bunny.usd); "
                "install warp-lang 1.13 or later, or take the scene 'mesh-file'"
            )
        mesh, notes = standing_mesh(usd.read(path), Path("bunny.usd"))
        return fitted_scene(mesh, parameters, notes=notes)


def bunny_path() -> Path:
    """Return where Warp keeps the mesh, without importing Warp."""
    warp = importlib.util.find_spec("warp")
    folder = Path(warp.origin).parent if warp is not None and warp.origin else Path()
    return folder / "examples" / "assets" / "bunny.usd"
