"""Artifacts are named by their content, whole, and checked when read."""

from __future__ import annotations

import errno
import hashlib
import os
from pathlib import Path

import pytest

from shadowbench.errors import StoreError
from shadowbench.store.artifacts import ArtifactFolder

CONTENT = b"\x89PNG picture"
DIGEST = hashlib.sha256(CONTENT).hexdigest()


def _files(folder: Path) -> list[str]:
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file())


def test_content_is_kept_under_its_sha256(tmp_path: Path) -> None:
    artifacts = ArtifactFolder(tmp_path)
    name = artifacts.put(CONTENT, "png")
    assert name == f"{DIGEST}.png"
    assert _files(tmp_path) == [f"{DIGEST[:2]}/{DIGEST}.png"]
    assert artifacts.get(name) == CONTENT


def test_equal_content_is_kept_once_and_empty_content_is_content(tmp_path: Path) -> None:
    artifacts = ArtifactFolder(tmp_path)
    assert artifacts.put(CONTENT, "png") == artifacts.put(CONTENT, ".png")
    assert artifacts.get(artifacts.put(b"", "bin")) == b""
    assert len(_files(tmp_path)) == 2


@pytest.mark.parametrize("damage", [b"", CONTENT[:-1], CONTENT + b"x", b"other"])
def test_a_damaged_file_is_refused_and_putting_it_again_mends_it(tmp_path: Path, damage: bytes) -> None:
    artifacts = ArtifactFolder(tmp_path)
    name = artifacts.put(CONTENT, "png")
    artifacts.path(name).write_bytes(damage)
    with pytest.raises(StoreError, match="the artifact is damaged"):
        artifacts.get(name)
    artifacts.put(CONTENT, "png")
    assert artifacts.get(name) == CONTENT


@pytest.mark.parametrize(
    "name",
    [
        "",
        "..",
        "../results.sqlite",
        f"../{DIGEST}.png",
        f"/{DIGEST}.png",
        f"{DIGEST}.png/../../results.sqlite",
        f"{DIGEST}.png\n",
        f"{DIGEST}.png\0",
        f"{DIGEST.upper()}.png",
        f"{DIGEST}",
        f"{DIGEST}.",
        f"{DIGEST}../",
        f"{DIGEST[:-1]}.png",
        f"{DIGEST}.toolongsuffix",
        "\udc80",
    ],
)
def test_names_cannot_lead_out_of_the_folder(tmp_path: Path, name: str) -> None:
    with pytest.raises(StoreError, match="is not an artifact's name") as caught:
        ArtifactFolder(tmp_path / "artifacts").get(name)
    assert "\n" not in str(caught.value)
    assert str(caught.value).isprintable()


@pytest.mark.parametrize("suffix", ["", "p/g", "../x", "PNG", "a.b", "ninechars", "\n"])
def test_a_suffix_is_letters_and_digits(tmp_path: Path, suffix: str) -> None:
    with pytest.raises(StoreError, match="suffix"):
        ArtifactFolder(tmp_path).put(CONTENT, suffix)
    assert _files(tmp_path) == []


def test_a_missing_artifact_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(StoreError, match="cannot read the artifact: no such file"):
        ArtifactFolder(tmp_path).get(f"{DIGEST}.png")


def test_a_full_disk_leaves_no_part_of_a_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(_: int) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(StoreError, match="cannot write the artifact: no space left on device"):
        ArtifactFolder(tmp_path).put(CONTENT, "png")
    assert _files(tmp_path) == []
