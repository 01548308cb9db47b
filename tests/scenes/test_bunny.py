"""The Stanford bunny: upright, on its feet, and a clear word where Warp has none."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from shadowbench.errors import SceneError
from shadowbench.scene import Scene
from shadowbench.scenes import bunny
from shadowbench.scenes.fitting import FitParameters

pytest.importorskip("pxr")


@pytest.fixture(scope="module")
def scene() -> Scene:
    return bunny.Bunny().make(FitParameters())


def test_the_bunny_stands_upright_on_its_feet(scene: Scene) -> None:
    vertices = scene.meshes[0].vertices
    height = vertices[:, 1]
    assert height.min() == 0.0

    def footprint(low: float, high: float) -> float:
        """Area of the rectangle that a horizontal slice takes."""
        inside = (height >= low * height.max()) & (height <= high * height.max())
        return float(np.prod(np.ptp(vertices[inside][:, [0, 2]], axis=0)))

    # a broad body below, two ears above; lying on its side or head it would be the other way round
    assert footprint(0.0, 0.3) > 2.0 * footprint(0.85, 1.0)
    # the feet touch the ground over most of the body's length, not in one point
    touching = vertices[height < 0.01 * height.max()]
    assert np.ptp(touching[:, 0]) > 0.4 * np.ptp(vertices[:, 0])
    assert len(touching) > 50


def test_the_whole_mesh_is_there_and_nothing_was_dropped(scene: Scene) -> None:
    assert scene.meshes[0].triangle_count == 12_200
    assert scene.notes == ()
    assert [m.name for m in scene.meshes] == ["bunny", "ground"]


def test_it_comes_out_the_same_twice(scene: Scene) -> None:
    again = bunny.Bunny().make(FitParameters())
    np.testing.assert_array_equal(again.meshes[0].vertices, scene.meshes[0].vertices)
    assert again.cameras == scene.cameras
    assert again.lights == scene.lights


def test_a_warp_without_the_mesh_is_named(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(bunny, "bunny_path", lambda: tmp_path / "bunny.usd")
    with pytest.raises(SceneError, match="warp-lang has no Stanford bunny") as caught:
        bunny.Bunny().make(FitParameters())
    assert "\n" not in str(caught.value)
