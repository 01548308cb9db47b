"""Mesh files as scenes: the same triangles from every format, and one line for every file that cannot be drawn."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mesh_files import (
    TRIANGLES,
    VERTICES,
    corners,
    glb,
    gltf,
    gltf_document,
    obj,
    ply,
    stl_binary,
    stl_text,
    usda,
    written,
)

from shadowbench.errors import ParameterError, SceneError
from shadowbench.parameters import parse_parameters
from shadowbench.scene import Scene
from shadowbench.scenes.mesh_file import MeshFile
from shadowbench.world import place


def _make(path: Path | str, **values: Any) -> Scene:
    parameters = parse_parameters(MeshFile.Parameters, {"path": str(path), **values}, owner="scene 'mesh-file'")
    return MeshFile().make(parameters)


def _message(path: Path | str, capfd: pytest.CaptureFixture[str], **values: Any) -> str:
    with pytest.raises(SceneError) as caught:
        _make(path, **values)
    assert capfd.readouterr() == ("", "")
    assert "\n" not in str(caught.value)
    return str(caught.value)


STANDING = VERTICES - [3.0, 2.0, 3.5]
"""The solid moved as mesh-file moves it: centred on x = z = 0, its lowest point at y = 0."""

FILES: dict[str, bytes | str] = {
    "text.ply": ply(),
    "little.ply": ply("binary_little_endian"),
    "BIG.PLY": ply("binary_big_endian", scalar="double"),
    "solid.obj": obj(),
    "binary.stl": stl_binary(),
    "text.stl": stl_text(),
    "solid.glb": glb(*gltf_document()),
    "solid.gltf": gltf(*gltf_document()),
    "solid.usda": usda(),
}


@pytest.mark.parametrize("name", FILES)
def test_every_format_gives_the_same_triangles(tmp_path: Path, name: str) -> None:
    scene = _make(written(tmp_path, name, FILES[name]))
    solid, ground = scene.meshes
    np.testing.assert_array_equal(corners(solid.vertices, solid.triangles), corners(STANDING, TRIANGLES))
    assert ground.triangle_count == 2
    assert scene.notes == ()


def test_vtk_gives_the_same_triangles(tmp_path: Path) -> None:
    pyvista = pytest.importorskip("pyvista")
    faces = np.column_stack([np.full(len(TRIANGLES), 3), TRIANGLES]).reshape(-1)
    pyvista.PolyData(VERTICES, faces).save(tmp_path / "solid.vtp")
    solid = _make(tmp_path / "solid.vtp").meshes[0]
    np.testing.assert_array_equal(corners(solid.vertices, solid.triangles), corners(STANDING, TRIANGLES))


def test_the_upward_axis_can_be_given(tmp_path: Path) -> None:
    path = written(tmp_path, "solid.ply", ply())
    assert np.ptp(_make(path, up="z").meshes[0].vertices[:, 1]) == 1.0
    assert np.ptp(_make(path).meshes[0].vertices[:, 1]) == 6.0


def test_the_ground_can_be_left_out(tmp_path: Path) -> None:
    assert len(_make(written(tmp_path, "solid.ply", ply()), ground="false").meshes) == 1


def test_a_home_folder_is_expanded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    written(tmp_path, "solid.ply", ply())
    monkeypatch.setenv("HOME", str(tmp_path))
    assert _make("~/solid.ply").meshes[0].triangle_count == len(TRIANGLES)


def test_the_same_file_gives_the_same_scene_wherever_it_lies(tmp_path: Path) -> None:
    (tmp_path / "other").mkdir()
    one, other = (_make(written(folder, "solid.obj", obj())) for folder in (tmp_path, tmp_path / "other"))
    np.testing.assert_array_equal(one.meshes[0].vertices, other.meshes[0].vertices)
    assert (one.lights, one.cameras) == (other.lights, other.cameras)


def test_a_scene_far_from_the_origin_is_placed_without_loss(tmp_path: Path) -> None:
    far = place(_make(written(tmp_path, "far.obj", obj(VERTICES + 1e6))))
    near = place(_make(written(tmp_path, "near.obj", obj())))
    np.testing.assert_array_equal(far.vertices, near.vertices)


def test_the_nearest_name_is_suggested_for_a_missing_file(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    written(tmp_path, "bunny.ply", ply())
    written(tmp_path, "bunny.txt", "notes")
    path = tmp_path / "buny.ply"
    assert _message(path, capfd) == f"{path}: no such file; did you mean 'bunny.ply'?"


def test_a_missing_folder_is_said(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    message = _message(tmp_path / "no" / "solid.ply", capfd)
    assert message.endswith(f"no such file; there is no folder {tmp_path / 'no'} either")


def test_a_folder_lists_its_meshes(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    assert _message(tmp_path, capfd) == f"{tmp_path}: is a folder; name one mesh file in it (there is none)"
    written(tmp_path, "solid.ply", ply())
    assert "(solid.ply)" in _message(tmp_path, capfd)


def test_a_link_to_nothing_says_where_it_leads(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    for name, target in (("astray.ply", "gone.ply"), ("loop.ply", "loop.ply")):
        path = tmp_path / name
        path.symlink_to(target)
        assert _message(path, capfd) == f"{path}: is a link to {target}, where there is no file"


def test_a_pipe_is_refused_instead_of_waited_for(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "pipe.ply"
    os.mkfifo(path)
    assert "not a file" in _message(path, capfd)


def test_an_unknown_extension_lists_the_known_ones(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    message = _message(written(tmp_path, "solid.step", "x"), capfd)
    assert "'.step'" in message
    for extension in (".ply", ".obj", ".stl", ".gltf", ".glb", ".vtk", ".vtp", ".vtu", ".usd"):
        assert extension in message


@pytest.mark.parametrize("name", ["a.ply", "a.obj", "a.stl", "a.glb", "a.gltf", "a.vtk", "a.vtp", "a.usd"])
def test_an_empty_file_is_refused(tmp_path: Path, name: str, capfd: pytest.CaptureFixture[str]) -> None:
    assert "is empty (0 bytes)" in _message(written(tmp_path, name, b""), capfd)


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("cut.ply", ply()[:-20], ["cut short"]),
        ("cut.ply", ply("binary_little_endian")[:-20], ["'face'", "cut short"]),
        ("nan.ply", ply().replace(b"4.5 ", b"nan "), ["vertex 4", "not finite"]),
        ("nan.obj", obj().replace(b"4.5 ", b"nan "), ["nan.obj:7:", "not finite"]),
        ("range.obj", obj().replace(b"f 4//1", b"f 9//1"), ["vertex 9", "the file has 5"]),
        ("range.ply", ply(faces=[[0, 1, 2], [0, 1, 5]]), ["face 1", "vertex 5"]),
        ("points.ply", ply(faces=[]), ["no faces", "only 5 points"]),
        ("points.obj", "v 0 0 0\nv 1 1 1\n", ["no faces", "only 2 points"]),
        ("short.stl", stl_binary(count=9), ["promises 9 triangles", "room for 6"]),
        ("huge.obj", obj(VERTICES * 1e300), ["vertex 0", "beyond"]),
        ("flat.obj", "v 0 0 0\nv 1 1 1\nv 2 2 2\nf 1 2 3\nf 1 1 2\n", ["none of its 2 faces has an area"]),
        ("cut.glb", glb(*gltf_document())[:-8], ["cut short"]),
        ("html.gltf", "<html>", ["html.gltf:1:", "not valid glTF"]),
        ("deep.gltf", "[" * 100_000, ["not valid glTF", "nested too deeply"]),
    ],
)
def test_a_damaged_file_is_one_line(
    tmp_path: Path, name: str, content: bytes | str, words: list[str], capfd: pytest.CaptureFixture[str]
) -> None:
    path = written(tmp_path, name, content)
    message = _message(path, capfd)
    assert message.startswith(f"{path}:")
    for word in words:
        assert word in message


def test_a_million_degenerate_triangles_are_a_note_and_a_correct_scene(tmp_path: Path) -> None:
    points = np.vstack([VERTICES, np.linspace(VERTICES[0], VERTICES[1], 1000)])
    row = np.dtype([("count", "u1"), ("corner", "<i4", 3)])
    table = np.zeros(1_000_000 + len(TRIANGLES), row)
    table["count"] = 3
    table["corner"][: len(TRIANGLES)] = TRIANGLES
    line = np.arange(1_000_000) % 998 + len(VERTICES)
    table["corner"][len(TRIANGLES) :] = line[:, None] + np.arange(3)
    header = ply("binary_little_endian", vertices=points, faces=[], face_count=len(table))
    scene = _make(written(tmp_path, "thin.ply", header + table.tobytes()))
    assert scene.notes == (f"{tmp_path / 'thin.ply'}: 1000000 of 1000006 triangles have no area and were left out",)
    solid = scene.meshes[0]
    np.testing.assert_array_equal(corners(solid.vertices, solid.triangles), corners(STANDING, TRIANGLES))


def test_the_path_is_required_and_names_are_checked() -> None:
    with pytest.raises(ParameterError, match="needs the parameter 'path'"):
        parse_parameters(MeshFile.Parameters, {}, owner="scene 'mesh-file'")
    with pytest.raises(ParameterError, match="no parameter 'pth'; did you mean 'path'"):
        parse_parameters(MeshFile.Parameters, {"pth": "x.ply"}, owner="scene 'mesh-file'")
    with pytest.raises(ParameterError, match="'auto', 'x', 'y' or 'z'"):
        parse_parameters(MeshFile.Parameters, {"path": "x.ply", "up": "w"}, owner="scene 'mesh-file'")
