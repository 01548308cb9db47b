"""Exported views: read again by our own reader and by trimesh, and held to the world and its receivers."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from builders import LIGHTS, windows_over_ground
from opened_views import opened

from shadowbench.errors import UsageError
from shadowbench.inspection.exporting import ARRAYS, export
from shadowbench.inspection.opening import OpenView
from shadowbench.scenes.formats import gltf


@cache
def _seen(light: str = "sun") -> OpenView:
    return opened(windows_over_ground(), light)


def _document(file: Path) -> dict[str, Any]:
    data = file.read_bytes()
    length = int.from_bytes(data[12:16], "little")
    document: dict[str, Any] = json.loads(data[20 : 20 + length])
    return document


def _node(document: dict[str, Any], name: str) -> np.ndarray:
    (node,) = (node for node in document["nodes"] if node["name"] == name)
    return np.array(node["matrix"]).reshape(4, 4).T


def test_our_own_reader_finds_the_same_triangles_to_the_bit(tmp_path: Path) -> None:
    world = _seen().world
    glb, _, _ = export(_seen(), tmp_path)
    read = gltf.read(glb)
    corners = read.vertices[read.corners].astype(np.float32).reshape(-1, 3, 3)
    assert np.array_equal(corners, world.vertices[world.triangles])


def test_trimesh_finds_the_same_surface(tmp_path: Path) -> None:
    world = _seen().world
    glb, _, _ = export(_seen(), tmp_path)
    loaded = trimesh.load_scene(glb)
    low, high = world.bounds()
    assert loaded.bounds == pytest.approx(np.stack([low, high]), abs=1e-6)
    assert sum(len(loaded.geometry[loaded.graph[n][1]].faces) for n in loaded.graph.nodes_geometry) == len(
        world.triangles
    )
    a, b, c = (world.vertices[world.triangles[:, k]].astype(np.float64) for k in range(3))
    assert loaded.area == pytest.approx(0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum(), rel=1e-6)


def test_instances_share_their_mesh_and_keep_their_transmittance(tmp_path: Path) -> None:
    glb, _, _ = export(_seen(), tmp_path)
    document = _document(glb)
    world = _seen().world
    assert len(document["accessors"]) == 2 * len(world.meshes)
    assert len(document["bufferViews"]) == 2 * len(world.meshes)
    for number, instance in enumerate(world.instances):
        node = document["nodes"][number]
        assert node["extras"]["instance"] == number
        (primitive,) = document["meshes"][node["mesh"]]["primitives"]
        material = document["materials"][primitive["material"]]
        assert material["extras"]["transmittance"] == list(instance.transmittance)
        assert ("extensions" in material) == (max(instance.transmittance) > 0.0)


def test_the_exported_camera_sees_each_receiver_in_its_pixel(tmp_path: Path) -> None:
    glb, npz, _ = export(_seen(), tmp_path)
    document, arrays = _document(glb), np.load(npz)
    seen_from = np.linalg.inv(_node(document, "camera"))
    (camera,) = document["cameras"]
    x, y, z = (seen_from[:3, :3] @ arrays["position"].T + seen_from[:3, 3:]).astype(np.float64)
    tangent = np.tan(camera["perspective"]["yfov"] / 2.0)
    column = (x / -z / (tangent * camera["perspective"]["aspectRatio"]) + 1.0) / 2.0 * arrays["width"]
    row = (1.0 - y / -z / tangent) / 2.0 * arrays["height"]
    assert np.array_equal(np.floor(row).astype(int) * arrays["width"] + np.floor(column).astype(int), arrays["pixel"])


@pytest.mark.parametrize("light", list(LIGHTS))
def test_the_exported_light_shines_where_the_scenes_does(light: str, tmp_path: Path) -> None:
    glb, npz, _ = export(_seen(light), tmp_path)
    document, own = _document(glb), _seen(light).light
    (punctual,) = document["extensions"]["KHR_lights_punctual"]["lights"]
    node = _node(document, "light")
    assert np.linalg.det(node[:3, :3]) == pytest.approx(1.0)
    along = -node[:3, 2]
    if light == "sun":
        assert punctual["type"] == "directional"
        assert along == pytest.approx(-np.asarray(own.direction), abs=1e-6)  # type: ignore[union-attr]
    else:
        assert node[:3, 3] == pytest.approx(own.position)  # type: ignore[union-attr]
    if light == "spot":
        assert along == pytest.approx(own.direction, abs=1e-6)  # type: ignore[union-attr]
        assert punctual["spot"]["outerConeAngle"] == pytest.approx(np.radians(own.angle) / 2.0)  # type: ignore[union-attr]
    assert len(np.load(npz)["light_projection"]) == (6 if light == "lamp" else 1)


def test_receivers_lie_on_the_triangles_that_they_name(tmp_path: Path) -> None:
    _, npz, described = export(_seen(), tmp_path)
    arrays, world = np.load(npz), _seen().world
    assert set(arrays.files) == set(ARRAYS) == set(json.loads(described.read_text())["arrays"])
    number = world.first_triangle[arrays["instance"]] + arrays["triangle"]
    assert np.array_equal(number, arrays["world_triangle"])
    a, b, c = (world.vertices[world.triangles[number][:, k]].astype(np.float64) for k in range(3))
    normal = np.cross(b - a, c - a)
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    assert np.abs(((arrays["position"] - a) * normal).sum(axis=1)).max() < 1e-6
    assert np.abs((normal * arrays["normal"]).sum(axis=1)) == pytest.approx(1.0, abs=1e-6)


def test_the_description_says_light_camera_and_channels(tmp_path: Path) -> None:
    _, _, file = export(_seen("spot"), tmp_path)
    said = json.loads(file.read_text())
    assert (said["light"]["kind"], said["light"]["angle"]) == ("SpotLight", 70.0)
    assert (said["width"], said["height"], said["channels"]) == (48, 36, 3)
    assert said["receivers"] == _seen("spot").receivers.count


def test_a_folder_that_cannot_be_made_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "taken").write_text("")
    with pytest.raises(UsageError, match="taken"):
        export(_seen(), tmp_path / "taken")
