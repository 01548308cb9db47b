"""Draws what :mod:`shadowbench.inspection.space` laid out, with pyvista, in a process of its own.

VTK ends the whole process where it finds no way to render. So the command line writes the arrays to a file and starts
``python -m shadowbench.inspection.drawing FILE.npz TARGET``; a target of ``-`` is a window, any other a
picture's file.
"""

from __future__ import annotations

import json
import sys
from typing import Any

import numpy as np

WINDOW = "-"
"""The target that is a window."""

SIZE = (1280, 960)
"""Of a picture [pixels]."""

_LIGHT, _CAMERA = "#c9a400", "#333333"
_LINE = 30
"""From line to line of the legend [pixels]."""


def plotter_of(arrays: dict[str, Any], said: dict[str, Any], *, off_screen: bool) -> Any:
    """Return a pyvista plotter with everything in it."""
    import pyvista

    pv: Any = pyvista  # whose functions are wrapped beyond what a type checker can follow
    plotter = pv.Plotter(off_screen=off_screen, window_size=list(SIZE))
    plotter.set_background("#eef1f6")
    triangles = arrays["triangles"]
    faces = np.concatenate([np.full((len(triangles), 1), 3, np.int64), triangles], axis=1)
    scene = pv.PolyData(arrays["vertices"].astype(np.float32), faces.reshape(-1))
    scene.cell_data["colour"] = arrays["colours"]
    plotter.add_mesh(scene, scalars="colour", rgb=True, ambient=0.35, diffuse=0.6, show_scalar_bar=False)
    points = pv.PolyData(arrays["points"].astype(np.float32))
    points.point_data["colour"] = arrays["point_colours"]
    plotter.add_mesh(points, scalars="colour", rgb=True, lighting=False, point_size=3.0, style="points")
    for name, colour, width in (("light_lines", _LIGHT, 3), ("camera_lines", _CAMERA, 3)):
        plotter.add_mesh(_lines(pv, arrays[name]), color=colour, line_width=width, lighting=False)
    for quad, picture in zip(arrays.get("map_quads", ()), arrays.get("maps", ()), strict=True):
        _add_map(pv, plotter, quad, picture)
    plotter.add_text(said["title"], position="upper_left", font_size=11, color="#111111")
    for line, (name, colour, count) in enumerate(said["legend"]):
        text = f"{name.replace('_', ' ')}: {count:,}"
        plotter.add_text(text, position=(14, 14 + _LINE * line), font_size=11, color=colour)
    plotter.camera_position = [tuple(said["beside"]), tuple(said["target"]), tuple(said["up"])]
    plotter.camera.view_angle = said["angle"]
    plotter.reset_camera_clipping_range()
    return plotter


def _lines(pv: Any, ends: Any) -> Any:
    count = len(ends) // 2
    cells = np.column_stack([np.full(count, 2), np.arange(0, 2 * count, 2), np.arange(1, 2 * count, 2)])
    return pv.PolyData(ends.astype(np.float32), lines=cells.reshape(-1))


def _add_map(pv: Any, plotter: Any, quad: Any, picture: Any) -> None:
    """Add a depth map as squares on its quad, one a texel."""
    size = len(picture)
    step = np.linspace(0.0, 1.0, size + 1)
    u, v = np.meshgrid(step, step)
    place = ((1 - u) * (1 - v))[..., None] * quad[0] + (u * (1 - v))[..., None] * quad[1]
    place = place + (u * v)[..., None] * quad[2] + ((1 - u) * v)[..., None] * quad[3]
    first = (np.arange(size)[:, None] * (size + 1) + np.arange(size)).reshape(-1)
    cells = np.column_stack([np.full(len(first), 4), first, first + 1, first + size + 2, first + size + 1])
    surface = pv.PolyData(place.reshape(-1, 3).astype(np.float32), cells.reshape(-1))
    surface.cell_data["colour"] = np.repeat(picture.reshape(-1, 1), 3, axis=1)
    plotter.add_mesh(surface, scalars="colour", rgb=True, lighting=False, opacity=0.5, show_scalar_bar=False)


def main(arguments: list[str]) -> int:
    """Draw a file's arrays to a target."""
    source, target = arguments
    with np.load(source, allow_pickle=False) as file:
        arrays = {name: file[name] for name in file.files}
    said = json.loads(str(arrays.pop("described")))
    plotter = plotter_of(arrays, said, off_screen=target != WINDOW)
    if target == WINDOW:
        plotter.show(title=f"shadowbench: {said['title']}")
    else:
        plotter.screenshot(target)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
