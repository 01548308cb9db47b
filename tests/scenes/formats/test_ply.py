"""The PLY reader: every layout, every way to be cut short, and VTK as the independent reader of well-formed files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mesh_files import CHANGES, TRIANGLES, VERTICES, changed, corners, ply, require_mesh_or_error, written

from shadowbench.errors import SceneError
from shadowbench.scenes.formats.ply import read
from shadowbench.scenes.formats.polygons import triangulate

FORMS = ("ascii", "binary_little_endian", "binary_big_endian")
POLYGON_FACES = [[0, 2, 1], [0, 1, 3, 4], [0, 3, 2], [1, 4, 3, 2, 0]]


@pytest.mark.parametrize("scalar", ["float", "double", "float32", "float64"])
@pytest.mark.parametrize("form", FORMS)
def test_vertices_and_triangles_come_out_as_written(tmp_path: Path, form: str, scalar: str) -> None:
    polygons = read(written(tmp_path, "solid.ply", ply(form, scalar=scalar)))
    np.testing.assert_array_equal(polygons.vertices, VERTICES)
    np.testing.assert_array_equal(polygons.corners.reshape(-1, 3), TRIANGLES)


@pytest.mark.parametrize("form", FORMS)
def test_double_precision_survives(tmp_path: Path, form: str) -> None:
    vertices = VERTICES + 1e6 + 1.0 / 3.0
    polygons = read(written(tmp_path, "far.ply", ply(form, scalar="double", vertices=vertices)))
    np.testing.assert_array_equal(polygons.vertices, vertices)


@pytest.mark.parametrize("form", FORMS)
def test_faces_of_unequal_size_are_read(tmp_path: Path, form: str) -> None:
    polygons = read(written(tmp_path, "solid.ply", ply(form, faces=POLYGON_FACES)))
    assert polygons.corner_counts.tolist() == [3, 4, 3, 5]
    assert polygons.corners.tolist() == [c for face in POLYGON_FACES for c in face]


@pytest.mark.parametrize("form", FORMS)
def test_vtk_reads_the_same(tmp_path: Path, form: str) -> None:
    pyvista = pytest.importorskip("pyvista")
    path = written(tmp_path, "solid.ply", ply(form))
    ours, theirs = read(path), pyvista.read(path)
    np.testing.assert_array_equal(
        corners(ours.vertices, triangulate(ours)), corners(theirs.points, theirs.faces.reshape(-1, 4)[:, 1:])
    )


def test_other_elements_properties_and_windows_line_ends_are_skipped(tmp_path: Path) -> None:
    content = (
        "ply\r\nformat ascii 1.0\r\nobj_info made for this test\r\n"
        "element material 1\r\nproperty list uchar uchar name\r\nproperty float shine\r\n"
        "element vertex 3\r\nproperty uchar red\r\nproperty float z\r\nproperty float y\r\nproperty float x\r\n"
        "element face 1\r\nproperty uchar flag\r\nproperty list int uint vertex_index\r\n"
        "property list uchar float texcoord\r\nend_header\r\n"
        "2 65 66 0.5\r\n255 3 2 1\r\n255 6 5 4\r\n255 9 8 8\r\n1 3 0 1 2 2 0.5 0.25\r\n"
    )
    polygons = read(written(tmp_path, "solid.ply", content))
    assert polygons.vertices.tolist() == [[1, 2, 3], [4, 5, 6], [8, 8, 9]]
    assert polygons.corners.tolist() == [0, 1, 2]


@pytest.mark.parametrize("faces", [None, POLYGON_FACES], ids=["triangles", "polygons"])
@pytest.mark.parametrize("form", FORMS)
def test_a_file_cut_short_anywhere_is_refused(tmp_path: Path, form: str, faces: list[list[int]] | None) -> None:
    content = ply(form, faces=faces)
    path = tmp_path / "cut.ply"
    body = content.index(b"end_header\n") + len(b"end_header\n")
    # in text, losing the last line end or part of the last number leaves a whole file
    last = len(content) - (2 if form == "ascii" else 0)
    for length in range(1, last, 1 if faces is None else 7):
        path.write_bytes(content[:length])
        with pytest.raises(SceneError) as caught:
            read(path)
        message = str(caught.value)
        assert message.startswith(f"{path}:")
        assert "\n" not in message
        if length > body and form != "ascii":
            assert "cut short" in message


def test_the_message_says_what_was_promised_and_where_the_file_ends(tmp_path: Path) -> None:
    path = written(tmp_path, "cut.ply", ply("binary_little_endian")[:-1])
    with pytest.raises(SceneError, match=r"promises 6 rows of 'face', but the file ends in row 6"):
        read(path)


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("promise", ["vertex_count", "face_count"])
def test_a_header_that_promises_billions_is_refused_at_once(tmp_path: Path, form: str, promise: str) -> None:
    path = written(tmp_path, "huge.ply", ply(form, **{promise: 4_000_000_000}))
    with pytest.raises(SceneError, match=r"cut short|does not hold"):
        read(path)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (b"ply\n", b"pl\n", ["does not begin with 'ply'"]),
        (b"format ascii 1.0\n", b"", ["names no format"]),
        (b"format ascii 1.0", b"format ascii 7.0", [":2:", "'format ascii 7.0'"]),
        (b"property float x", b"property quaternion x", [":5:", "quaternion"]),
        (b"element vertex 5", b"element vertex -5", [":4:", "-5"]),
        (b"property float x", b"property float w", ["x, y and z"]),
        (b"property float x", b"property float y", [":6:", "property float y"]),
        (b"element face 6", b"element vertex 6", [":8:", "element vertex 6"]),
        (b"property float x", b"property list uchar float x", ["'vertex'"]),
        (b"1.0 2.0 3.0", b"1.0 two 3.0", ["not a number"]),
        (b"\n3 0 2 1", b"\n3 0 2.5 1", ["not a whole number"]),
        (b"\n3 0 2 1", b"\n-3 0 2 1", ["row 1 of 'face'"]),
        (b"element face 6", b"element tristrips 6", ["triangle strips"]),
    ],
)
def test_damage_is_named(tmp_path: Path, old: bytes, new: bytes, words: list[str]) -> None:
    content = ply()
    assert content.count(old) >= 1
    path = written(tmp_path, "bad.ply", content.replace(old, new, 1))
    with pytest.raises(SceneError) as caught:
        read(path)
    for word in words:
        assert word in str(caught.value)


@settings(max_examples=300, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(form=st.sampled_from(FORMS), changes=CHANGES)
def test_flipped_bytes_give_an_error_or_a_mesh_never_a_crash(
    tmp_path: Path, form: str, changes: list[tuple[int, int]]
) -> None:
    content = changed(ply(form, faces=POLYGON_FACES), changes)
    require_mesh_or_error(read, written(tmp_path, "flipped.ply", content))
