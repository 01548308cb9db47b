"""Any mesh file as a scene.

The file's triangles are turned upright, moved so that the mesh stands on the origin, and rounded to float32 once; a
ground, lights and a camera are fitted round it. Triangles without an area are left out and counted in the scene's
notes.
"""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from pydantic import BaseModel

from shadowbench.parameters import parameter
from shadowbench.scene import Scene, ScenePlugin

from .fitting import FitParameters, fitted_scene
from .formats import read_mesh
from .standing import standing_mesh


class MeshFile(ScenePlugin):
    """See the module."""

    name = "mesh-file"
    title = "A mesh file"

    class Parameters(FitParameters):
        """The file and how it stands."""

        path: Path = parameter(unit="1", help="PLY, OBJ, STL, glTF, GLB, VTK or USD file.")
        up: Literal["auto", "x", "y", "z"] = parameter(
            "auto", unit="1", help="The file's upward axis; auto is what the file says, or else y."
        )
        ground: bool = parameter(True, unit="1", help="Whether the mesh stands on a ground that takes its shadow.")

    def make(self, parameters: BaseModel) -> Scene:
        """Read the file and fit the rest."""
        assert isinstance(parameters, self.Parameters)
        path = parameters.path.expanduser()
        up = None if parameters.up == "auto" else parameters.up
        mesh, notes = standing_mesh(read_mesh(path), path, up=up)
        return fitted_scene(mesh, parameters, with_ground=parameters.ground, notes=notes)
