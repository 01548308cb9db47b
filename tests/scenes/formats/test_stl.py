"""The STL reader: binary and text, counts that lie, and VTK as the independent reader of well-formed files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mesh_files import (
    CHANGES,
    TRIANGLES,
    VERTICES,
    changed,
    corners,
    require_mesh_or_error,
    stl_binary,
    stl_text,
    written,
)

from shadowbench.errors import SceneError
from shadowbench.scenes.formats.polygons import check, triangulate
from shadowbench.scenes.formats.stl import read

CONTENTS = {"binary": stl_binary(), "text": stl_text(), "binary that says solid": stl_binary(header=b"solid by hand")}


@pytest.mark.parametrize("content", CONTENTS.values(), ids=CONTENTS)
def test_triangles_come_out_as_written(tmp_path: Path, content: bytes) -> None:
    polygons = read(written(tmp_path, "solid.stl", content))
    np.testing.assert_array_equal(corners(polygons.vertices, polygons.corners), corners(VERTICES, TRIANGLES))


@pytest.mark.parametrize("content", CONTENTS.values(), ids=CONTENTS)
def test_equal_corners_become_one_vertex(tmp_path: Path, content: bytes) -> None:
    assert len(read(written(tmp_path, "solid.stl", content)).vertices) == len(VERTICES)


def test_a_negative_zero_is_a_zero(tmp_path: Path) -> None:
    soup = np.array([[(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(-0.0, 0, 0), (0, 1, 0), (-1, 0, 0)]], np.float32)
    assert len(read(written(tmp_path, "solid.stl", stl_binary(soup))).vertices) == 4


@pytest.mark.parametrize("content", CONTENTS.values(), ids=CONTENTS)
def test_vtk_reads_the_same(tmp_path: Path, content: bytes) -> None:
    pyvista = pytest.importorskip("pyvista")
    path = written(tmp_path, "solid.stl", content)
    ours, theirs = read(path), pyvista.read(path)
    np.testing.assert_array_equal(
        corners(ours.vertices, triangulate(ours)), corners(theirs.points, theirs.faces.reshape(-1, 4)[:, 1:])
    )


@pytest.mark.parametrize("count", [0, 5, 7, 4_000_000_000])
def test_a_count_that_disagrees_with_the_length_is_refused(tmp_path: Path, count: int) -> None:
    path = written(tmp_path, "solid.stl", stl_binary(count=count))
    with pytest.raises(SceneError, match=rf"promises {count} triangles, but the file has room for 6"):
        read(path)


@pytest.mark.parametrize("content", [stl_binary(), stl_text()], ids=["binary", "text"])
def test_a_file_cut_short_anywhere_is_refused(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "cut.stl"
    for length in range(1, len(content.rstrip(b"\n")) - len(b" by hand") - 1):
        path.write_bytes(content[:length])
        with pytest.raises(SceneError) as caught:
            read(path)
        assert "\n" not in str(caught.value)


def test_a_facet_with_four_corners_is_named(tmp_path: Path) -> None:
    text = "solid a\nfacet normal 0 0 1\nouter loop\n" + "vertex 0 0 0\n" * 4 + "endloop\nendfacet\nendsolid\n"
    with pytest.raises(SceneError, match=r"bad\.stl:8: a facet has 4 corners"):
        read(written(tmp_path, "bad.stl", text))


def test_a_vertex_that_is_not_finite_is_refused(tmp_path: Path) -> None:
    soup = VERTICES[TRIANGLES].astype(np.float32)
    soup[2, 1, 0] = np.nan
    path = written(tmp_path, "nan.stl", stl_binary(soup))
    with pytest.raises(SceneError, match="not finite"):
        check(read(path), path)


def test_no_triangles_is_said(tmp_path: Path) -> None:
    path = written(tmp_path, "none.stl", "solid nothing\nendsolid nothing\n")
    with pytest.raises(SceneError, match="no faces"):
        check(read(path), path)


@settings(max_examples=200, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(content=st.sampled_from([stl_binary(), stl_text()]), changes=CHANGES)
def test_flipped_bytes_give_an_error_or_a_mesh_never_a_crash(
    tmp_path: Path, content: bytes, changes: list[tuple[int, int]]
) -> None:
    require_mesh_or_error(read, written(tmp_path, "flipped.stl", changed(content, changes)))
