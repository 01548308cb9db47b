"""USD stages: transforms, orientation, visibility, axes, and what they refuse."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from mesh_files import TRIANGLES, VERTICES, signed_volume, usda, written

from shadowbench.errors import SceneError
from shadowbench.scenes.formats.polygons import triangulate

pytest.importorskip("pxr")

from shadowbench.scenes.formats import usd


def test_vertices_and_triangles_come_out_as_written(tmp_path: Path) -> None:
    polygons = usd.read(written(tmp_path, "solid.usda", usda()))
    np.testing.assert_array_equal(polygons.vertices, VERTICES)
    np.testing.assert_array_equal(polygons.corners.reshape(-1, 3), TRIANGLES)
    assert polygons.notes == ()


@pytest.mark.parametrize("extension", [".usdc", ".usd", ".usdz"])
def test_binary_and_packed_stages_are_read(tmp_path: Path, extension: str) -> None:
    from pxr import Usd, UsdUtils

    text = written(tmp_path, "solid.usda", usda())
    path = tmp_path / f"solid{extension}"
    if extension == ".usdz":
        assert UsdUtils.CreateNewUsdzPackage(str(text), str(path))
    else:
        Usd.Stage.Open(str(text)).Export(str(path))
    np.testing.assert_array_equal(usd.read(path).vertices, VERTICES)


@pytest.mark.parametrize(("axis", "up"), [("Y", "y"), ("Z", "z")])
def test_the_stage_says_which_axis_is_up(tmp_path: Path, axis: str, up: str) -> None:
    assert usd.read(written(tmp_path, "solid.usda", usda(up=axis))).up == up


def test_transforms_of_all_levels_apply(tmp_path: Path) -> None:
    xform = 'double3 xformOp:translate = (10, 20, 30)\n    uniform token[] xformOpOrder = ["xformOp:translate"]'
    mesh = 'float xformOp:rotateY = 90\n        uniform token[] xformOpOrder = ["xformOp:rotateY"]'
    polygons = usd.read(written(tmp_path, "solid.usda", usda(xform=xform, mesh=mesh)))
    expected = VERTICES[:, [2, 1, 0]] * [1, 1, -1] + np.array([10, 20, 30])
    np.testing.assert_allclose(polygons.vertices, expected, atol=1e-12)


MIRROR = 'float3 xformOp:scale = (1, 1, -1)\n        uniform token[] xformOpOrder = ["xformOp:scale"]'


@pytest.mark.parametrize(
    ("mesh", "sign"),
    [
        ("", 1.0),
        (MIRROR, 1.0),
        ('uniform token orientation = "leftHanded"', -1.0),
        ('uniform token orientation = "leftHanded"\n        ' + MIRROR, -1.0),
    ],
    ids=["as written", "mirrored", "left-handed", "both"],
)
def test_faces_turn_with_mirrors_and_orientation(tmp_path: Path, mesh: str, sign: float) -> None:
    polygons = usd.read(written(tmp_path, "solid.usda", usda(mesh=mesh)))
    volume = signed_volume(polygons.vertices, triangulate(polygons))
    assert volume == pytest.approx(sign * signed_volume(VERTICES, TRIANGLES))


def test_hidden_meshes_and_guides_are_not_drawn(tmp_path: Path) -> None:
    for line in ('token visibility = "invisible"', 'uniform token purpose = "guide"'):
        with pytest.raises(SceneError, match="no visible mesh"):
            usd.read(written(tmp_path, "solid.usda", usda(mesh=line)))
        with pytest.raises(SceneError, match="no visible mesh"):
            usd.read(written(tmp_path, "solid.usda", usda(xform=line)))


def test_shapes_that_are_no_meshes_are_noted(tmp_path: Path) -> None:
    text = usda() + '\ndef Sphere "ball"\n{\n}\n'
    polygons = usd.read(written(tmp_path, "solid.usda", text))
    assert len(polygons.notes) == 1
    assert "1 shapes" in polygons.notes[0]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("#usda 1.0\n", "no visible mesh"),
        ('#usda 1.0\ndef Sphere "ball"\n{\n}\n', "1 other shapes"),
        ("junk", "not a readable USD file"),
        ('#usda 1.0\ndef Xform "root" (\n    references = @nowhere.usda@\n)\n{\n}\n', "nowhere.usda"),
        (usda().replace("faceVertexCounts = [3, ", "faceVertexCounts = [4, "), "19 corners but has 18"),
        (usda().replace("faceVertexCounts = [3, ", "faceVertexCounts = [-3, "), "corners"),
    ],
)
def test_damage_is_named(tmp_path: Path, text: str, words: str, capfd: pytest.CaptureFixture[str]) -> None:
    path = written(tmp_path, "bad.usda", text)
    with pytest.raises(SceneError) as caught:
        usd.read(path)
    capfd.readouterr()  # USD's own noise; read_isolated keeps it from the user
    assert str(caught.value).startswith(f"{path}: ")
    assert "\n" not in str(caught.value)
    assert words in str(caught.value)
