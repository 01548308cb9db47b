"""Scenes are listed without the libraries that some of them read with."""

from __future__ import annotations

import subprocess
import sys

HEAVY = ("pandas", "pxr", "pyvista", "scipy", "vtk", "vtkmodules", "warp")


def test_importing_every_scene_loads_no_heavy_library() -> None:
    code = (
        "import sys\n"
        "from importlib.metadata import entry_points\n"
        "names = {p.value.partition(':')[0] for p in entry_points(group='shadowbench.scenes')}\n"
        "for name in names:\n"
        "    if name.startswith('shadowbench.scenes.'): __import__(name)\n"
        f"print(len(names), [m for m in {HEAVY!r} if m in sys.modules])\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    count, _, loaded = done.stdout.strip().partition(" ")
    assert int(count) >= 4
    assert loaded == "[]"
