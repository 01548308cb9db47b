"""The casters' maps as one picture for the report, each with what it stands for written under it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from shadowbench.device.map_pool import MapPool
from shadowbench.light_picture import FACE_NAMES, depth_sheet
from shadowbench.methods.instanced.maps import MapKey, MapRequest
from shadowbench.scene import Mesh

MOST_SHOWN = 24
"""Maps in the picture; of more, some are chosen evenly over meshes and angles."""

_UPRIGHT = (0.0, 1.0, 0.0)


def maps_picture(
    requests: Mapping[MapKey, MapRequest], pool: MapPool, meshes: Sequence[Mesh]
) -> NDArray[np.uint8] | None:
    """Return the picture of all maps, by mesh and angle; ``None`` if there are none.

    Args:
        requests: What each map shows.
        pool: The maps.
        meshes: The scene's.
    """
    ordered = sorted(requests, key=lambda key: _order(requests[key]))
    if not ordered:
        return None
    places = np.unique(np.linspace(0, len(ordered) - 1, min(MOST_SHOWN, len(ordered))).round().astype(int))
    shown = [ordered[place] for place in places]
    named = [(_named(requests[key], meshes), pool.map(key).numpy()) for key in shown]
    return depth_sheet(named, left_out=len(ordered) - len(shown))


def _order(request: MapRequest) -> tuple[object, ...]:
    rotation = request.rotation
    angle = (rotation.axis, rotation.angle) if rotation is not None else ((), 0.0)
    return request.mesh, *angle, request.casters[0], request.face


def _named(request: MapRequest, meshes: Sequence[Mesh]) -> str:
    """Return what a map stands for: a mesh at an angle, or a caster as the light, or one of its faces, sees it."""
    name = meshes[request.mesh].name
    if request.rotation is None:
        face = "" if request.face is None else f" {FACE_NAMES[request.face]}"
        return f"{name}, caster {request.casters[0]}{face}"
    angle = f"{name} {request.rotation.angle:.4g}\u00b0"
    axis = request.rotation.axis
    if request.rotation.angle == 0.0 or axis == _UPRIGHT:
        return angle
    return f"{angle} about {' '.join(f'{part:.2g}' for part in axis)}"
