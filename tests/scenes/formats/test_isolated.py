"""Reading in a child process: results cross unchanged, and a crash or noise costs one line."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
from mesh_files import TRIANGLES, VERTICES, usda, written

from shadowbench.errors import SceneError
from shadowbench.scenes.formats import isolated, read_mesh

pytest.importorskip("pxr")


def _impostor(monkeypatch: pytest.MonkeyPatch, folder: Path, script: str) -> None:
    """Let a shell script stand for the child's Python."""
    shell = folder / "python"
    shell.write_text(f"#!/bin/sh\n{script}\n")
    shell.chmod(0o755)
    monkeypatch.setattr(isolated.sys, "executable", str(shell))


def test_polygons_cross_unchanged(tmp_path: Path) -> None:
    text = usda(up="Z") + '\ndef Sphere "ball"\n{\n}\n'
    polygons = read_mesh(written(tmp_path, "solid.usda", text))
    np.testing.assert_array_equal(polygons.vertices, VERTICES)
    np.testing.assert_array_equal(polygons.corners.reshape(-1, 3), TRIANGLES)
    assert polygons.up == "z"
    assert len(polygons.notes) == 1


def test_the_readers_own_message_crosses_and_its_noise_does_not(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    path = written(tmp_path, "bad.usda", "junk")
    with pytest.raises(SceneError, match=r"bad\.usda: is not a readable USD file"):
        read_mesh(path)
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("cut.vtp", b'<?xml version="1.0"?>\n<VTKFile type="PolyData" version="0.1"><PolyData><Piece', "VTK says"),
        (
            "cut.vtk",
            b"# vtk DataFile Version 3.0\nby hand\nASCII\nDATASET POLYDATA\nPOINTS 5 float\n0 0 0 1 0 0 0 1 0\n",
            "Error reading ascii data",
        ),
        ("junk.vtk", b"junk", "Unrecognized file type"),
    ],
)
def test_what_vtk_writes_to_the_error_stream_becomes_the_error(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], name: str, content: bytes, words: str
) -> None:
    path = written(tmp_path, name, content)
    with pytest.raises(SceneError) as caught:
        read_mesh(path)
    assert capfd.readouterr() == ("", "")
    assert str(caught.value).startswith(f"{path}: ")
    assert "\n" not in str(caught.value)
    assert words in str(caught.value)


def test_a_reader_that_crashes_is_one_line(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    _impostor(monkeypatch, tmp_path, "kill -SEGV $$")
    with pytest.raises(SceneError, match=r"bad\.vtu: the VTK reader crashed \(SIGSEGV\)"):
        read_mesh(written(tmp_path, "bad.vtu", "x"))


def test_a_reader_that_fails_is_one_line(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    _impostor(monkeypatch, tmp_path, "exit 3")
    with pytest.raises(SceneError, match=r"bad\.usd: the USD reader failed \(exit status 3\)"):
        read_mesh(written(tmp_path, "bad.usd", "x"))


def test_a_file_of_the_working_folder_does_not_pass_for_a_module(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    (tmp_path / "numpy.py").write_text("raise SystemExit(9)")
    path = written(tmp_path, "solid.usda", usda())
    monkeypatch.chdir(tmp_path)
    assert "" not in sys.path[:1] or sys.path[0] != str(tmp_path)
    assert len(read_mesh(path).vertices) == len(VERTICES)
