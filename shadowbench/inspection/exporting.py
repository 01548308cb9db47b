"""A view written out for other programs: the scene, its receivers, and what both mean.

::

    scene.glb        the placed scene (:mod:`shadowbench.inspection.gltf_writing`)
    receivers.npz    the visible samples: what a visibility must be given for
    scene.json       light, camera and sizes in numbers, and what every array holds

A visibility that another program makes of them is measured by ``shadowbench score``.
"""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from shadowbench.errors import UsageError
from shadowbench.inspection.gltf_writing import write_glb
from shadowbench.inspection.opening import OpenView
from shadowbench.light_space import light_frames
from shadowbench.scene import RectangularLight

ARRAYS: dict[str, str] = {
    "pixel": "row * width + column, row 0 at the top, int32 [n]; receivers are sorted by it",
    "layer": "0 for the nearest surface of a sample, int32 [n]",
    "weight": "share of the pixel, float32 [n]",
    "alpha": "opacity of the surface, float32 [n]",
    "position": "surface point in the recentred world, float32 [n, 3]",
    "normal": "unit geometric normal, turned towards the camera, float32 [n, 3]",
    "instance": "number of the instance: the glTF node's extras.instance, int32 [n]",
    "triangle": "number within the instance's mesh, int32 [n]",
    "world_triangle": "number over all instances in order, int32 [n]",
    "position_dx": "motion of the point in its triangle's plane for a pixel to the right, float32 [n, 3]",
    "position_dy": "the same for a pixel down, float32 [n, 3]",
    "valid": "whether its visibility is asked for, bool [n]",
    "in_field": "whether the light reaches it at all, bool [n]; elsewhere visibility is 0 by definition",
    "first_of_pixel": "receivers of pixel p are first_of_pixel[p] to first_of_pixel[p + 1], int32 [width * height + 1]",
    "width": "of the picture, in pixels",
    "height": "of the picture, in pixels",
    "eye": "the camera's position in the recentred world, float64 [3]",
    "world_origin": "what was subtracted from the authored scene's positions, float64 [3]",
    "light_projection": (
        "world to light space, float64 [faces, 4, 4] with rows u*w, v*w, depth, w; v grows downwards, depth is linear, "
        "0 near to 1 far; faces +x -x +y -y +z -z of a point light, none of an area light"
    ),
}
"""Every array of ``receivers.npz``."""


def export(seen: OpenView, folder: Path) -> list[Path]:
    """Write a view to a folder, which is made if it is not there.

    Returns:
        The files.

    Raises:
        UsageError: The folder or a file cannot be written.
    """
    files = [folder / name for name in ("scene.glb", "receivers.npz", "scene.json")]
    receivers = seen.receivers
    try:
        folder.mkdir(parents=True, exist_ok=True)
        write_glb(files[0], seen.world, seen.light, seen.camera, width=receivers.width, height=receivers.height)
        np.savez_compressed(files[1], **_arrays(seen))
        text = json.dumps(_description(seen), indent=2, allow_nan=False)
        files[2].write_text(text + "\n", encoding="utf-8")
    except OSError as error:
        raise UsageError(f"{error.filename or folder}: {error.strerror or error}") from error
    return files


def _arrays(seen: OpenView) -> dict[str, Any]:
    receivers, world = seen.receivers, seen.world
    own = ("pixel", "layer", "weight", "alpha", "position", "normal", "instance", "position_dx", "position_dy", "valid")
    frames = () if isinstance(seen.light, RectangularLight) else light_frames(seen.light, world)
    return {
        **{name: getattr(receivers, name) for name in own},
        "triangle": (receivers.triangle - world.first_triangle[receivers.instance]).astype(np.int32),
        "world_triangle": receivers.triangle,
        "in_field": seen.reference.in_field,
        "first_of_pixel": receivers.first_of_pixel,
        "width": np.int32(receivers.width),
        "height": np.int32(receivers.height),
        "eye": np.array(receivers.eye),
        "world_origin": np.array(world.origin),
        "light_projection": np.array([frame.projection for frame in frames]).reshape(-1, 4, 4),
    }


def _description(seen: OpenView) -> dict[str, Any]:
    view, receivers, world = seen.view, seen.receivers, seen.world
    return {
        "scene": {"name": view.scene, "parameters": view.scene_parameters, "triangles": view.triangles},
        "light": {"name": view.light, "kind": type(seen.light).__name__, **asdict(seen.light)},
        "camera": {"name": view.camera, **asdict(seen.camera)},
        "width": receivers.width,
        "height": receivers.height,
        "pixel_samples": view.pixel_samples,
        "layers": view.layers,
        "receivers": receivers.count,
        "channels": 1 if world.casters.is_opaque else 3,
        "world_origin": world.origin,
        "conventions": (
            "right-handed, y up; positions of the recentred world: add world_origin for the authored one; a "
            "directional light's direction points towards it, a spot's along the beam; angles in degrees"
        ),
        "arrays": ARRAYS,
        "answer": (
            "visibility, 1 lit to 0 shadowed, per receiver [n] or per pixel [height, width] (with a last axis of 3 "
            "where channels is 3), as .npy, .exr or .png, for shadowbench score"
        ),
    }
