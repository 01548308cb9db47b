"""The OBJ reader: its index arithmetic, its line numbers, and VTK as the independent reader of well-formed files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from mesh_files import CHANGES, TRIANGLES, VERTICES, changed, corners, obj, require_mesh_or_error, written

from shadowbench.errors import SceneError
from shadowbench.scenes.formats.obj import read
from shadowbench.scenes.formats.polygons import triangulate

TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\n"


def test_vertices_and_triangles_come_out_as_written(tmp_path: Path) -> None:
    polygons = read(written(tmp_path, "solid.obj", obj()))
    np.testing.assert_array_equal(polygons.vertices, VERTICES)
    np.testing.assert_array_equal(polygons.corners.reshape(-1, 3), TRIANGLES)


def test_vtk_reads_the_same(tmp_path: Path) -> None:
    pyvista = pytest.importorskip("pyvista")
    path = written(tmp_path, "solid.obj", obj())
    ours, theirs = read(path), pyvista.read(path)
    np.testing.assert_array_equal(
        corners(ours.vertices, triangulate(ours)), corners(theirs.points, theirs.faces.reshape(-1, 4)[:, 1:])
    )


@pytest.mark.parametrize(
    "text",
    [
        TRIANGLE + "f 1 2 3",
        TRIANGLE + "f 1/7 2/8 3/9\n",
        TRIANGLE + "f 1//7 2//8 3//9\n",
        TRIANGLE + "f 1/4/7 2/5/8 3/6/9\n",
        TRIANGLE + "f -3 -2 -1\n",
        TRIANGLE + "f -3/1 -2/2 -1/3\nv 9 9 9\n",
        TRIANGLE + "  \t f 1 2 3   \n",
        TRIANGLE + "f 1 2 \\\n3\n",
        TRIANGLE + "f 1 \\  \n 2 \\\r\n 3\r\n",
        "f 1 2 3\n" + TRIANGLE,
        TRIANGLE.replace("\n", " 1.0\n") + "f 1 2 3\n",
        TRIANGLE.replace("\n", " 0.5 0.5 0.5\n") + "f 1 2 3\n",
        "mtllib x.mtl\nvt 0 0\nvn 0 0 1\n" + TRIANGLE + "usemtl a\ng b\ns 1\nl 1 2\np 1\nf 1 2 3\n",
        "# v 7 7 7\n\n\n" + TRIANGLE + "#f 1 1 1\nf 1 2 3\n",
    ],
)
def test_ways_to_write_one_triangle(tmp_path: Path, text: str) -> None:
    polygons = read(written(tmp_path, "one.obj", text))
    assert polygons.vertices[polygons.corners].tolist() == [[0, 0, 0], [1, 0, 0], [0, 1, 0]]


def test_faces_keep_their_sizes(tmp_path: Path) -> None:
    polygons = read(written(tmp_path, "two.obj", TRIANGLE + "v 1 1 0\nf 1 2 4 3\nf 1 2 3\nf 1 2\n"))
    assert polygons.corner_counts.tolist() == [4, 3, 2]


def test_double_precision_survives(tmp_path: Path) -> None:
    vertices = VERTICES + 1e6 + 1.0 / 3.0
    np.testing.assert_array_equal(read(written(tmp_path, "far.obj", obj(vertices))).vertices, vertices)


@pytest.mark.parametrize(
    ("text", "line", "words"),
    [
        ("v 0 0 0\nv 1 nan 0\nv 0 1 0\nf 1 2 3\n", 2, ["not finite", "1 nan 0"]),
        ("v 0 0 0\nv 1 0 0\nv 0 -inf 0\nf 1 2 3\n", 3, ["not finite"]),
        ("v 0 0 0\nv 1 1e999 0\nv 0 1 0\nf 1 2 3\n", 2, ["not finite"]),
        ("v 0 0 0\nv 1 0\nv 0 1 0\nf 1 2 3\n", 2, ["three numbers", "'1 0'"]),
        ("v 0 0 0\nv 1 0 -1.#IND\nv 0 1 0\nf 1 2 3\n", 2, ["three numbers"]),
        ("v 0,5 0,5 0,5\n", 1, ["three numbers"]),
        ("# head\n\n" + TRIANGLE + "f 1 2 4\n", 6, ["vertex 4", "the file has 3"]),
        (TRIANGLE + "f 0 1 2\n", 4, ["vertex 0", "counts from 1"]),
        (TRIANGLE + "f 1 2 3\nf -1 -2 -4\n", 5, ["vertex -4", "only 3"]),
        (TRIANGLE + "f 1 2 3\nf 1 b 3\n", 5, ["whole numbers", "'1 b 3'"]),
        (TRIANGLE + "f 1 2.5 3\n", 4, ["whole numbers"]),
        (TRIANGLE + "f 1 /2 3\n", 4, ["whole numbers"]),
        (TRIANGLE + "f 1 2 99999999999999999999\n", 4, ["the file has 3"]),
        (TRIANGLE + "f 1 \\\n2 \\\n3\nf 1 2 4\n", 7, ["vertex 4"]),
    ],
)
def test_the_line_of_the_damage_is_named(tmp_path: Path, text: str, line: int, words: list[str]) -> None:
    path = written(tmp_path, "bad.obj", text)
    with pytest.raises(SceneError) as caught:
        read(path)
    assert str(caught.value).startswith(f"{path}:{line}: ")
    for word in words:
        assert word in str(caught.value)


def test_a_message_quotes_nothing_that_a_terminal_would_obey(tmp_path: Path) -> None:
    with pytest.raises(SceneError) as caught:
        read(written(tmp_path, "bad.obj", b"v 0 \x1b[31m\x07 " + b"9" * 500 + b"\n"))
    assert str(caught.value).isprintable()
    assert len(str(caught.value)) < len(str(tmp_path)) + 200


def test_a_file_that_is_no_obj_is_refused(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match="neither vertices nor faces"):
        read(written(tmp_path, "page.obj", "<!doctype html>\n<p>404\n"))


@settings(max_examples=300, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(changes=CHANGES)
def test_flipped_bytes_give_an_error_or_a_mesh_never_a_crash(tmp_path: Path, changes: list[tuple[int, int]]) -> None:
    require_mesh_or_error(read, written(tmp_path, "flipped.obj", changed(obj(), changes)))
