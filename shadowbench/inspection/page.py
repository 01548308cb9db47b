"""A case in space as one HTML file that loads nothing: the arrays within, drawn by WebGL in a page of our own."""

from __future__ import annotations

import base64
import json
from importlib import resources
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shadowbench.inspection.space import Arrays


def page(arrays: Arrays, described: dict[str, Any]) -> str:
    """Return the page.

    Args:
        arrays, described: As :func:`shadowbench.inspection.space.laid_out` returns them.
    """
    vertices: NDArray[Any] = arrays["vertices"]
    colours = np.zeros((len(vertices), 3), np.uint8)
    colours[arrays["triangles"].reshape(-1)] = np.repeat(arrays["colours"], 3, axis=0)  # a vertex is one instance's
    limits = vertices.max(axis=0).astype(np.float64) - vertices.min(axis=0)
    said = described | {
        "diagonal": float(np.sqrt((limits * limits).sum())),
        "map_size": int(arrays["maps"].shape[1]) if "maps" in arrays else 0,
    }
    buffers = {
        "vertices": vertices.astype("<f4"),
        "triangles": arrays["triangles"].astype("<u4"),
        "vertex_colours": colours,
        "points": arrays["points"].astype("<f4"),
        "point_colours": arrays["point_colours"],
    }
    for name in ("light_lines", "camera_lines", "map_quads"):
        if name in arrays:
            buffers[name] = arrays[name].astype("<f4")
    if "maps" in arrays:
        buffers["maps"] = arrays["maps"]
    encoded = {name: base64.b64encode(np.ascontiguousarray(held).tobytes()).decode() for name, held in buffers.items()}
    template = resources.files("shadowbench.inspection").joinpath("templates/space.html").read_text(encoding="utf-8")
    whole = template.replace("__DESCRIBED__", _script(said))
    return whole.replace("__BUFFERS__", _script(encoded))


def _script(value: Any) -> str:
    """Return JSON that cannot end the element that it stands in."""
    return json.dumps(value, allow_nan=False).replace("<", "\\u003c").replace("\u2028", "\\u2028")
