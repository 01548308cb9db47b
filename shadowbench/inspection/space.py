"""A case laid out in space: what :mod:`shadowbench.inspection.drawing` draws, as arrays that fit into a file.

The scene, its receivers painted with their shadows and failures, the light's window as a frustum with its depth maps
at the near plane, and the camera. A scene of more triangles than can be turned on any machine is thinned: no mesh, over
all its instances, keeps more than any other may, and of those that have more, evenly chosen triangles stay and grow to
cover what they stand for (Cook et al. 2007, Stochastic Simplification of Aggregate Detail); receivers say what the
surface truly is. Instances are looked up, never flattened: what is held is what is drawn.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from shadowbench.depth_map_method import DepthMapMethod
from shadowbench.light_space import Frame, camera_frame, light_frames
from shadowbench.pictures import FAILURE_COLOURS, shaded, to_srgb, towards
from shadowbench.scene import DirectionalLight, RectangularLight, Rotation

if TYPE_CHECKING:
    from shadowbench.inspection.opening import OpenCase, OpenView

MOST_TRIANGLES = 300_000
"""Of the scene, when drawn."""

MOST_POINTS = 250_000
"""Receivers, when drawn."""

_TURNS = (-70.0, -50.0, -35.0, 35.0, 50.0, 70.0)
"""How far round one may stand from the case's camera at first [degrees]."""

_FAR = 1.25
"""And how far from its target [diagonals of the world]."""

MAP_TEXELS = 256
"""Width of a drawn depth map at most."""

Arrays = dict[str, NDArray[Any]]

_CORNERS = np.array([(u, v, d) for d in (0.0, 1.0) for u, v in ((0, 0), (1, 0), (1, 1), (0, 1))], np.float64)
_EDGES = np.array([(0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7)])


def laid_out(case: OpenCase) -> tuple[Arrays, dict[str, Any]]:
    """Return everything to draw: arrays, and a description as JSON values.

    Arrays are ``vertices``, ``triangles`` and ``colours`` of the scene; ``points`` and ``point_colours`` of the
    receivers; ``light_lines`` and ``camera_lines``, pairs of ends; ``map_quads`` [faces, 4, 3] and ``maps``
    [faces, size, size] where the technique has depth maps.
    """
    seen = case.seen
    vertices, triangles, colours, kept_share = _scene(seen)
    points, point_colours, counts = _receivers(case)
    arrays: Arrays = {
        "vertices": vertices,
        "triangles": triangles,
        "colours": colours,
        "points": points,
        "point_colours": point_colours,
        "light_lines": _light_lines(seen),
        "camera_lines": _camera_lines(seen),
    }
    if isinstance(case.method, DepthMapMethod):
        arrays |= _maps(seen, case.method)
    legend = [(name, "#" + bytes(FAILURE_COLOURS[name]).hex(), count) for name, count in counts.items() if count]
    row = case.row
    described = {
        "title": f"{row.method_title or row.method} on {row.scene}",
        "legend": legend,
        "kept_share": kept_share,
        "eye": list(seen.camera.eye),
        "beside": _beside(seen),
        "target": list(seen.camera.target),
        "up": list(seen.camera.up),
        "angle": seen.camera.vertical_angle,
    }
    return arrays, described


def unprojected(frame: Frame, places: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the world positions of window places (u, v, depth), shape [n, 3]."""
    depth = places[:, 2]
    w = np.ones_like(depth) if frame.near is None else frame.near + depth * frame.depth_range
    rows = np.stack([places[:, 0] * w, places[:, 1] * w, depth, w])
    return np.asarray(np.linalg.solve(frame.projection, rows)[:3].T, np.float64)


def _beside(seen: OpenView) -> list[float]:
    """Return where to stand at first: beside the camera, far enough to see all of it, and not behind a depth map."""
    camera, light = seen.camera, seen.light
    target = np.asarray(camera.target, np.float64)
    offset = np.asarray(camera.eye, np.float64) - target
    offset *= _FAR * seen.world.diagonal() / np.sqrt((offset * offset).sum())
    to_light = towards(light, np.asarray(target, np.float32)[None])[0]
    turns = [Rotation(camera.up, angle).matrix() for angle in _TURNS]
    turned = [(turn * offset).sum(axis=1) for turn in turns]
    chosen: list[float] = (target + min(turned, key=lambda from_target: abs(float(from_target @ to_light)))).tolist()
    return chosen


def _scene(seen: OpenView) -> tuple[NDArray[np.float32], NDArray[np.int32], NDArray[np.uint8], float]:
    """Return the scene's triangles, thinned where there are too many, their colours, and the share that is left."""
    world = seen.world
    counts = np.diff(world.first_triangle)
    allowed = _allowed(counts, np.array([instance.mesh for instance in world.instances]))
    kept = np.concatenate(
        [
            first + (np.arange(share) * count) // max(share, 1)
            for first, count, share in zip(world.first_triangle, counts, allowed, strict=False)
        ]
    ).astype(np.int64)
    owner = world.instance_of(kept)
    colours = to_srgb(0.75 * np.array([instance.albedo for instance in world.instances], np.float64)[owner])
    if len(kept) == world.triangle_count and world.is_flat:
        return world.vertices, world.triangles, colours, 1.0
    corners = world.corners_of(kept)
    grown = np.sqrt(counts / np.maximum(allowed, 1))[owner].astype(np.float32)[:, None, None]
    middle = corners.mean(axis=1, keepdims=True)
    vertices: NDArray[np.float32] = np.where(grown > 1.0, middle + grown * (corners - middle), corners).reshape(-1, 3)
    triangles = np.arange(len(vertices), dtype=np.int32).reshape(-1, 3)
    return vertices, triangles, colours, len(kept) / world.triangle_count


def _allowed(counts: NDArray[np.int64], mesh: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return how many triangles each instance keeps: its part of its mesh's share.

    So a ground that is there once stays whole under a thousand trees.
    """
    allowed = np.zeros_like(counts)
    meshes, totals = np.unique(mesh), np.bincount(mesh, counts).astype(np.int64)
    for number, share in zip(meshes, fair_shares(totals[meshes], MOST_TRIANGLES), strict=True):
        own = np.flatnonzero(mesh == number)
        allowed[own] = fair_shares(counts[own], int(share))
    return allowed


def fair_shares(counts: NDArray[np.int64], most: int) -> NDArray[np.int64]:
    """Return how much of ``most`` each may keep: all it has, or as many as any other.

    Of more of them than that, evenly chosen ones keep one each.
    """
    if int(counts.sum()) <= most:
        return counts.copy()
    if len(counts) > most:
        shares = np.zeros_like(counts)
        shares[np.linspace(0, len(counts) - 1, most).astype(np.int64)] = 1
        return np.minimum(shares, counts)
    ordered = np.sort(counts)
    before = np.concatenate([[0], np.cumsum(ordered)])[:-1]
    # with the limit at each count in turn, those below keep all; the largest limit that fits
    limits = (most - before) // np.arange(len(ordered), 0, -1)
    limit = int(limits[np.argmax(limits < ordered)])
    return np.minimum(counts, limit)


def _receivers(case: OpenCase) -> tuple[NDArray[np.float32], NDArray[np.uint8], dict[str, int]]:
    """Return receivers, a little off their surface, coloured as the picture is, with failures painted on."""
    seen, receivers = case.seen, case.seen.receivers
    masks = case.measured.masks | case.trace.masks
    picture = shaded(seen.world, seen.light, receivers, case.visibility).reshape(-1, 3)
    colours = picture[receivers.pixel]
    counts = {}
    for name, colour in FAILURE_COLOURS.items():
        if name in masks:
            colours[masks[name]] = colour
            counts[name] = int(masks[name].sum())
    failing = np.zeros(receivers.count, bool)
    for name in counts:
        failing |= masks[name]
    step = max(1, -(-receivers.count // MOST_POINTS))
    chosen = np.flatnonzero(failing | (np.arange(receivers.count) % step == 0))
    lift = np.float32(5.0e-4 * seen.world.diagonal())
    points: NDArray[np.float32] = receivers.position[chosen] + lift * receivers.normal[chosen]
    return points, colours[chosen], counts


def _light_lines(seen: OpenView) -> NDArray[np.float64]:
    """Return the edges of the light's windows as pairs of ends, shape [2 n, 3]."""
    light = seen.light
    if isinstance(light, RectangularLight):
        corner, u, v = (np.asarray(side, np.float64) for side in (light.corner, light.edge_u, light.edge_v))
        ring = np.stack([corner, corner + u, corner + u + v, corner + v])
        return np.stack([ring, np.roll(ring, -1, axis=0)], axis=1).reshape(-1, 3)
    frames = light_frames(light, seen.world)
    return np.concatenate([unprojected(frame, _CORNERS)[_EDGES].reshape(-1, 3) for frame in frames])


def _camera_lines(seen: OpenView) -> NDArray[np.float64]:
    """Return the camera as a pyramid from the eye to a window before it."""
    receivers, world = seen.receivers, seen.world
    frame = camera_frame(seen.camera, receivers.width, receivers.height, world)
    eye = np.asarray(seen.camera.eye, np.float64)
    far = unprojected(frame, np.array([(u, v, 0.5) for u, v in ((0, 0), (1, 0), (1, 1), (0, 1))], np.float64))
    ahead = far.mean(axis=0) - eye
    reach = min(1.0, 0.12 * world.diagonal() / float(np.sqrt((ahead * ahead).sum())))
    ring = eye + reach * (far - eye)
    sides = np.stack([np.broadcast_to(eye, ring.shape), ring], axis=1).reshape(-1, 3)
    return np.concatenate([sides, np.stack([ring, np.roll(ring, -1, axis=0)], axis=1).reshape(-1, 3)])


def _maps(seen: OpenView, method: DepthMapMethod) -> Arrays:
    """Return the light's depth maps as grey pictures, and where their corners lie: on the near plane."""
    depth = method.depth.numpy()
    step = -(-depth.shape[2] // MAP_TEXELS)
    shown: NDArray[Any] = depth[:, ::step, ::step].astype(np.float64)
    drawn = shown[shown < 1.0]
    low, high = (float(drawn.min()), float(drawn.max())) if drawn.size else (0.0, 1.0)
    grey = np.where(shown < 1.0, 40.0 + 190.0 * (1.0 - (shown - low) / max(high - low, 1e-12)), 20.0)
    near = 0.0 if isinstance(seen.light, DirectionalLight) else 0.02
    corners = _CORNERS[:4].copy()
    corners[:, 2] = near
    quads = np.stack([unprojected(frame, corners) for frame in light_frames(seen.light, seen.world)])
    return {"map_quads": quads, "maps": grey.astype(np.uint8)}
