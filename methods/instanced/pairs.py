"""Light source/shadow caster pairs: which maps there are to draw, and how every caster looks them up (section 5.1).

A map is drawn from a mesh in the mesh's own space, once, whatever instances there are. Under parallel light it is
determined by the mesh and by the direction to the light *in that space*, which scaling alike along all axes and
translating leave as it is: such instances share the map, and each has its own transform from the world to it. A
rotation turns the light in the mesh's space; the maps of the neighbouring steps stand in for it, with the receiver
brought to the mesh's space by each step's own rotation, that is, as if the caster stood at that angle. Under a spot or
point light every instance sees the light from elsewhere and gets a map of its own, under a point light one for each of
the six faces that it reaches into.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from shadowbench.device.arrays import as_warp
from shadowbench.device.bounding_volumes import OrientedBoxes
from shadowbench.device.map_pool import MapPool
from shadowbench.device.visibility import ULP
from shadowbench.light_space import CUBE_AXES, axes_of
from shadowbench.methods.instanced.angles import Neighbours
from shadowbench.methods.instanced.kernels import CasterMaps
from shadowbench.methods.instanced.maps import CasterMeshes, MapKey, MapRequest
from shadowbench.methods.instanced.windows import (
    FAR_DEPTH,
    Array,
    PerspectiveWindows,
    Window,
    after,
    corners_of,
    orthographic_window,
    turned,
)
from shadowbench.scene import DirectionalLight, Instance, Light, PointLight, RectangularLight, Rotation, SpotLight
from shadowbench.world import Casters

ROUNDING_ULPS = 4
"""Taken off a receiver's depth beside the bias, in ulps of the scene's largest coordinate: a receiver's float32
position and the world's float32 vertices lie together at most so far from the mesh that was drawn."""

_NEAREST = 1.0e-4
"""Without a near distance of the light's own, nothing nearer than this casts, relative to the world's diagonal."""

FACES = len(CUBE_AXES)


@dataclass(frozen=True, eq=False)
class Pairs:
    """All casters under one light, in an order that does not depend on the order of the instances.

    Attributes:
        light: The light.
        boxes: The casters' bounding boxes.
        transmittance: float32, shape [n, 3].
        from_world: Rows (u·w, v·w, depth less the bias, w) of each caster's views, shape [n, views of a caster, 4, 4].
        near: w below which nothing is in a view's map, shape [n, views of a caster].
        share: Of each view in the result; 0 where a caster has fewer views.
        length: One unit of a view's depth in the world [scene units].
        keys: Of the map behind each view; ``None`` if there is none.
        requests: The maps, by key.
    """

    light: DirectionalLight | SpotLight | PointLight
    boxes: OrientedBoxes
    transmittance: NDArray[np.float32]
    from_world: Array
    near: Array
    share: Array
    length: Array
    keys: list[list[MapKey | None]]
    requests: dict[MapKey, MapRequest]

    @property
    def are_interpolated(self) -> bool:
        """Whether any caster has a second map under parallel light."""
        return isinstance(self.light, DirectionalLight) and bool((self.share[:, 1:] > 0.0).any())

    def packed(self, pool: MapPool) -> CasterMaps:
        """Return what look-up kernels take, with the maps where the pool has them."""
        flat = [key for keys in self.keys for key in keys]
        place = np.array(
            [(0, 0) if key is None else (pool.first_texel[key], pool.resolution[key]) for key in flat], np.int32
        ).reshape(-1, 2)
        from_world = self.from_world.reshape(-1, 4, 4).copy()
        from_world[:, :2] *= place[:, 1, None, None]
        device = pool.device
        maps = CasterMaps()
        maps.depth = pool.depth
        maps.views_of_caster = wp.int32(self.share.shape[1])
        maps.texel_from_world = as_warp(from_world.reshape(-1, 4), wp.vec4d, device)
        maps.near = as_warp(self.near.reshape(-1), wp.float64, device)
        maps.share = as_warp(self.share.reshape(-1), wp.float64, device)
        maps.length = as_warp((self.share * self.length).reshape(-1), wp.float64, device)
        maps.place = as_warp(place, wp.vec2i, device)
        maps.transmittance = as_warp(self.transmittance, wp.vec3, device)
        if isinstance(self.light, PointLight):
            maps.light = wp.vec3d(*self.light.position)
        return maps


def pair_up(
    casters: Casters, light: Light, neighbours_of: Callable[[Rotation], Neighbours], bias: float, meshes: CasterMeshes
) -> Pairs:
    """Pair a light with all casters.

    Args:
        casters: What casts.
        light: Directional, spot or point.
        neighbours_of: Which rotations' maps stand for a rotation, under parallel light.
        bias: Constant bias, as a share of a caster's depth range.
        meshes: The casters', prepared.
    """
    instances = sorted(casters.instances, key=_content)
    pairing = _Pairing(casters, instances, meshes)
    assert not isinstance(light, RectangularLight), "an area light has no maps"
    if isinstance(light, DirectionalLight):
        pairing.under_parallel_light(light, neighbours_of)
    else:
        pairing.under_light_from_a_place(light)
    return pairing.pairs(light, bias)


def _content(instance: Instance) -> tuple[Any, ...]:
    """What to order instances by, so that products of transmittances come out the same in whatever order they were."""
    rotation = instance.rotation
    return instance.transmittance, instance.translation, rotation.angle, rotation.axis, instance.scale, instance.mesh


class _Pairing:
    """Collects what :class:`Pairs` holds, caster by caster."""

    def __init__(self, casters: Casters, instances: list[Instance], meshes: CasterMeshes) -> None:
        self._casters, self._instances = casters, instances
        of_mesh = [meshes.of(casters, i.mesh) for i in instances]
        self._mesh_centre = np.array([mesh.centre for mesh in of_mesh]).reshape(-1, 3)
        self._translation = np.array([i.translation for i in instances], dtype=np.float64).reshape(-1, 3)
        self._scale = np.array([i.scale for i in instances], dtype=np.float64).reshape(-1, 3)
        rotation = np.array([i.rotation.matrix() for i in instances]).reshape(-1, 3, 3)
        linear = rotation * self._scale[:, None, :]
        self.boxes = OrientedBoxes(
            half=np.array([mesh.half for mesh in of_mesh]).reshape(-1, 3),
            world_from_box=linear,
            box_from_world=rotation.transpose(0, 2, 1) / self._scale[:, :, None],
            centre=turned(linear, self._mesh_centre) + self._translation,
        )
        self.keys: list[list[MapKey | None]] = []
        self.requests: dict[MapKey, MapRequest] = {}
        self._from_world: Array
        self._reserve(views_of_a_caster=1)

    def under_parallel_light(self, light: DirectionalLight, neighbours_of: Callable[[Rotation], Neighbours]) -> None:
        """One map, or the two of the neighbouring steps, for each caster; shared by all that see the light alike."""
        towards = np.asarray(light.direction, dtype=np.float64)
        towards = towards / np.sqrt((towards * towards).sum())
        self._reserve(views_of_a_caster=2)
        mesh_from_world = np.zeros((len(self._instances), 2, 3, 3))
        windows: dict[tuple[int, tuple[float, ...]], Window] = {}
        turns: dict[Rotation, Array] = {}
        for row, instance in enumerate(self._instances):
            for slot, (rotation, share) in enumerate(neighbours_of(instance.rotation)):
                turn = turns.setdefault(rotation, rotation.matrix())
                mesh_from_world[row, slot] = turn.T / self._scale[row][:, None]
                # scaled alike along all axes, the direction is the same to the bit
                unscaled = turned(turn.T, towards) / (self._scale[row] / abs(self._scale[row, 0]))
                length = np.sqrt((unscaled * unscaled).sum())
                direction = unscaled / length
                seen = instance.mesh, tuple(direction.tolist())
                if seen not in windows:
                    windows[seen] = orthographic_window(self.boxes.half[row], direction)
                # the map's unit of length is the mesh's, seen along the light
                of_world = windows[seen].depth_range * abs(self._scale[row, 0]) / length
                self._add(row, slot, windows[seen], share, of_world, rotation=rotation)
        offset = -turned(mesh_from_world, self._translation[:, None]) - self._mesh_centre[:, None]
        self._from_world = after(self._from_world, mesh_from_world, offset)

    def under_light_from_a_place(self, light: SpotLight | PointLight) -> None:
        """A map for each caster, or one for each face of a point light that the caster reaches into."""
        eye = np.asarray(light.position, dtype=np.float64)
        nearest = light.near or _NEAREST * self._casters.world.diagonal()
        reach = turned(self.boxes.world_from_box[:, None], corners_of(self.boxes.half))
        corners = self.boxes.centre[:, None] + reach
        if isinstance(light, SpotLight):
            tangent = float(np.tan(np.radians(light.angle) / 2.0))
            views = [PerspectiveWindows(eye, axes_of(light.direction), tangent, nearest, corners)]
        else:
            views = [PerspectiveWindows(eye, axes_of(ahead, up), 1.0, nearest, corners) for ahead, up in CUBE_AXES]
        self._reserve(views_of_a_caster=len(views))
        for slot, view in enumerate(views):
            for row in view.seen.tolist():
                window = view.window(row)
                if window is not None:
                    face = slot if len(views) > 1 else None
                    self._add(row, slot, window, 1.0, window.depth_range, face=face)

    def pairs(self, light: DirectionalLight | SpotLight | PointLight, bias: float) -> Pairs:
        """Return all that was collected."""
        rounding = ROUNDING_ULPS * ULP * self._casters.scale / self._length
        self._from_world[..., 2, 3] -= (bias + rounding) * FAR_DEPTH
        return Pairs(
            light,
            self.boxes,
            np.array([i.transmittance for i in self._instances], np.float32).reshape(-1, 3),
            self._from_world,
            self._near,
            self._share,
            self._length,
            self.keys,
            self.requests,
        )

    def _reserve(self, *, views_of_a_caster: int) -> None:
        shape = len(self._instances), views_of_a_caster
        self._from_world = np.zeros((*shape, 4, 4))
        self._near = np.full(shape, -np.inf)
        self._share = np.zeros(shape)
        self._length = np.ones(shape)
        self.keys = [[None] * views_of_a_caster for _ in self._instances]

    def _add(
        self,
        row: int,
        slot: int,
        window: Window,
        share: float,
        length: float,
        *,
        rotation: Rotation | None = None,
        face: int | None = None,
    ) -> None:
        """Let a caster look up the map of a window; ``length`` is the window's depth range in the world."""
        mesh = self._instances[row].mesh
        drawn = window.projection
        if window.near is not None:  # from the world: the mesh is drawn where the instance stands
            drawn = after(drawn, self.boxes.world_from_box[row], self.boxes.centre[row])
            self._near[row, slot] = window.near
        self._from_world[row, slot] = window.projection
        self._share[row, slot], self._length[row, slot] = share, length
        key = mesh, self._casters.meshes[mesh].version, drawn.tobytes(), window.near
        request = MapRequest(mesh, drawn, window.near, rotation, face)
        self.requests.setdefault(key, request).casters.append(row)
        self.keys[row][slot] = key
