"""``shadowbench export-scene`` and ``shadowbench score``."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from inspection_cases import measured

from shadowbench.store import Store

VIEW = ("--size", "48x32", "--light", "sun")


def test_a_scene_goes_out_and_a_visibility_of_it_comes_back(command: Callable[..., Any], tmp_path: Path) -> None:
    ended = command("export-scene", "box-on-plane", "-o", "out", *VIEW, "--results", "r")
    assert (ended.status, ended.err) == (0, "")
    assert [Path(line).name for line in ended.out.splitlines()] == ["scene.glb", "receivers.npz", "scene.json"]
    with np.load(tmp_path / "out" / "receivers.npz") as arrays:
        count = len(arrays["pixel"])
    np.save(tmp_path / "lit.npy", np.ones(count, np.float32))
    arguments = ("score", "lit.npy", "--scene", "box-on-plane", *VIEW, "--name", "my-engine", "--results", "r")
    ended = command(*arguments, "--json")
    assert ended.status == 0
    row = json.loads(ended.out)
    assert (row["method"], row["outcome"], row["receivers"]) == ("my-engine", "ok", count)
    assert row["false_lit_count"] > 0
    assert row["false_shadow_count"] == 0
    ended = command(*arguments)
    assert ended.status == 0
    assert "my-engine" in ended.out
    ended = command("table", row["run_id"], "--results", "r", "--format", "markdown")
    assert ended.status == 0
    assert "my-engine" in ended.out


def test_a_visibility_scores_beside_a_case(command: Callable[..., Any], tmp_path: Path) -> None:
    (row,) = measured(tmp_path / "r", "no-shadows")
    np.save(tmp_path / "lit.npy", np.ones((32, 48), np.float32))
    arguments = ("score", "lit.npy", "--case", row.case_key[:8], "--name", "mine", "--results", "r")
    ended = command(*arguments, "--append", "--json")
    assert ended.status == 0
    scored = json.loads(ended.out)
    for name in ("failure_count", "false_lit_count", "scored", "rmse", "ssim", "flip"):
        assert scored[name] == getattr(row, name)
    with Store.open(tmp_path / "r") as store:
        assert [r.method for r in store.rows(row.run_id)] == ["no-shadows", "mine"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("score", "lit.npy"), "either --case CASE or --scene SCENE"),
        (("score", "lit.npy", "--case", "a", "--scene", "b"), "either --case CASE or --scene SCENE"),
        (("score", "lit.npy", "--scene", "bunny", "--append"), "need --case"),
        (("score", "lit.npy", "--scene", "bunny", "--name", "a b"), "--name"),
        (("score", "lit.npy", "--scene", "bunny", "--name", "pcf"), "is a method here"),
        (("score", "none.npy", "--scene", "box-on-plane", "--size", "8x8"), "does not exist"),
        (("export-scene", "no-such-scene", "-o", "out"), "no scene is called"),
        (("export-scene", "bunny:nope=1", "-o", "out"), "nope"),
        (("export-scene", "box-on-plane", "-o", "out", "--light", "moon"), "has no light 'moon'"),
        (("export-scene", "box-on-plane", "-o", "out", "--size", "8"), "WIDTHxHEIGHT"),
        (("export-scene", "random-triangles:triangles=10/20", "-o", "out"), "one scene at a time"),
    ],
)
def test_wrong_usage_is_one_line(command: Callable[..., Any], arguments: tuple[str, ...], message: str) -> None:
    ended = command(*arguments)
    assert ended.status == 2
    (line,) = ended.err.splitlines()
    assert message in line
