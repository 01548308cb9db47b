"""A placed scene as one GLB file: instances as nodes that share a mesh, a camera, a light, materials.

Positions are those of the recentred world, in which receivers are given too. What glTF has no word for stands in
``extras``: a material's transmittance, whether an instance casts and receives, an area light.
"""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from shadowbench.light_space import axes_of
from shadowbench.scene import DirectionalLight, Instance, Light, PointLight, RectangularLight, SpotLight

if TYPE_CHECKING:
    from shadowbench.scene import Camera, Vector
    from shadowbench.world import World

_FLOAT, _UNSIGNED = 5126, 5125
_VERTICES, _INDICES = 34962, 34963


def write_glb(path: Path, world: World, light: Light, camera: Camera, *, width: int, height: int) -> None:
    """Write a GLB file.

    Args:
        path: Where to.
        world: The placed scene.
        light: One of its lights.
        camera: One of its cameras.
        width, height: Of the picture, for the camera's aspect ratio [pixels].

    Raises:
        OSError: The file cannot be written.
    """
    written = _Document(world)
    written.add_instances()
    written.add_camera(camera, width / height)
    written.add_light(light)
    path.write_bytes(written.content())


class _Document:
    """A glTF document that grows."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._binary = bytearray()
        self._meshes: dict[tuple[int, int], int] = {}
        self._materials: dict[tuple[Vector, Vector], int] = {}
        self._accessors: dict[int, tuple[int, int]] = {}
        self._json: dict[str, Any] = {
            "asset": {"version": "2.0", "generator": "shadowbench"},
            "scene": 0,
            "scenes": [{"nodes": []}],
            "nodes": [],
            "meshes": [],
            "materials": [],
            "accessors": [],
            "bufferViews": [],
        }

    def add_instances(self) -> None:
        """Add a node for each instance; equal meshes of equal material exist once."""
        for number, instance in enumerate(self._world.instances):
            mesh = self._world.meshes[instance.mesh]
            node: dict[str, Any] = {
                "name": f"{mesh.name} {number}",
                "mesh": self._mesh(instance),
                "extras": {"instance": number, "casts": instance.casts, "receives": instance.receives},
            }
            if not instance.is_placed_as_modelled:
                node["matrix"] = _columns(instance.matrix())
            self._add_node(node)

    def add_camera(self, camera: Camera, aspect: float) -> None:
        """Add a camera: it looks along its node's -z."""
        right, down, ahead = axes_of(np.subtract(camera.target, camera.eye), camera.up)
        self._json["cameras"] = [
            {
                "type": "perspective",
                "perspective": {
                    "yfov": math.radians(camera.vertical_angle),
                    "aspectRatio": aspect,
                    "znear": 1.0e-4 * self._world.diagonal(),
                },
            }
        ]
        matrix = np.column_stack([right, -down, -ahead, np.asarray(camera.eye, np.float64)])
        self._add_node({"name": "camera", "camera": 0, "matrix": _columns(matrix)})

    def add_light(self, light: Light) -> None:
        """Add a light: it shines along its node's -z. An area light is told in ``extras`` only."""
        if isinstance(light, RectangularLight):
            corner, u, v = light.corner, light.edge_u, light.edge_v
            self._add_node({"name": "light", "extras": {"corner": corner, "edge_u": u, "edge_v": v}})
            return
        punctual: dict[str, Any] = {"name": "light", "color": [1.0, 1.0, 1.0], "intensity": 1.0}
        place, ahead = np.zeros(3), np.array([0.0, 0.0, -1.0])
        match light:
            case DirectionalLight():
                punctual["type"], ahead = "directional", -np.asarray(light.direction, np.float64)
            case SpotLight():
                punctual["type"], ahead = "spot", np.asarray(light.direction, np.float64)
                punctual["spot"] = {"innerConeAngle": 0.0, "outerConeAngle": math.radians(light.angle) / 2.0}
                place = np.asarray(light.position, np.float64)
            case PointLight():
                punctual["type"], place = "point", np.asarray(light.position, np.float64)
        right, down, forward = axes_of(ahead)
        matrix = np.column_stack([right, -down, -forward, place])
        self._json["extensionsUsed"] = [*self._json.get("extensionsUsed", []), "KHR_lights_punctual"]
        self._json["extensions"] = {"KHR_lights_punctual": {"lights": [punctual]}}
        self._add_node(
            {"name": "light", "matrix": _columns(matrix), "extensions": {"KHR_lights_punctual": {"light": 0}}}
        )

    def content(self) -> bytes:
        """Return the file."""
        self._json["buffers"] = [{"byteLength": len(self._binary)}]
        text = json.dumps(self._json, allow_nan=False, separators=(",", ":")).encode()
        text += b" " * (-len(text) % 4)
        binary = bytes(self._binary) + b"\0" * (-len(self._binary) % 4)
        chunks = len(text).to_bytes(4, "little") + b"JSON" + text
        chunks += len(binary).to_bytes(4, "little") + b"BIN\0" + binary
        return b"glTF" + (2).to_bytes(4, "little") + (12 + len(chunks)).to_bytes(4, "little") + chunks

    def _add_node(self, node: dict[str, Any]) -> None:
        self._json["scenes"][0]["nodes"].append(len(self._json["nodes"]))
        self._json["nodes"].append(node)

    def _mesh(self, instance: Instance) -> int:
        key = instance.mesh, self._material(instance)
        if key not in self._meshes:
            mesh = self._world.meshes[instance.mesh]
            if instance.mesh not in self._accessors:
                vertices = mesh.vertices.astype("<f4")
                limits = {"min": vertices.min(axis=0).tolist(), "max": vertices.max(axis=0).tolist()}
                self._accessors[instance.mesh] = (
                    self._accessor(vertices, "VEC3", _FLOAT, _VERTICES, limits),
                    self._accessor(mesh.triangles.astype("<u4").reshape(-1), "SCALAR", _UNSIGNED, _INDICES, {}),
                )
            position, indices = self._accessors[instance.mesh]
            primitive = {"attributes": {"POSITION": position}, "indices": indices, "material": key[1]}
            self._meshes[key] = len(self._json["meshes"])
            self._json["meshes"].append({"name": mesh.name, "primitives": [primitive]})
        return self._meshes[key]

    def _material(self, instance: Instance) -> int:
        key = instance.albedo, instance.transmittance
        if key not in self._materials:
            self._materials[key] = len(self._json["materials"])
            surface = {"baseColorFactor": [*instance.albedo, 1.0], "metallicFactor": 0.0, "roughnessFactor": 1.0}
            material: dict[str, Any] = {
                "pbrMetallicRoughness": surface,
                "doubleSided": True,
                "extras": {"transmittance": instance.transmittance},
            }
            if max(instance.transmittance) > 0.0:
                surface["baseColorFactor"] = [*(t / max(instance.transmittance) for t in instance.transmittance), 1.0]
                factor = {"transmissionFactor": max(instance.transmittance)}
                material["extensions"] = {"KHR_materials_transmission": factor}
                used = self._json.setdefault("extensionsUsed", [])
                if "KHR_materials_transmission" not in used:
                    used.append("KHR_materials_transmission")
            self._json["materials"].append(material)
        return self._materials[key]

    def _accessor(self, values: NDArray[Any], kind: str, component: int, target: int, limits: dict[str, Any]) -> int:
        view = {"buffer": 0, "byteOffset": len(self._binary), "byteLength": values.nbytes, "target": target}
        self._binary += np.ascontiguousarray(values).tobytes()
        self._json["bufferViews"].append(view)
        self._json["accessors"].append(
            {
                "bufferView": len(self._json["bufferViews"]) - 1,
                "componentType": component,
                "count": len(values),
                "type": kind,
                **limits,
            }
        )
        return len(self._json["accessors"]) - 1


def _columns(matrix: NDArray[np.float64]) -> list[float]:
    """Return a [3, 4] matrix as glTF stores it: sixteen numbers by columns."""
    whole = np.vstack([matrix, [0.0, 0.0, 0.0, 1.0]])
    found: list[float] = whole.T.reshape(-1).tolist()
    return found
