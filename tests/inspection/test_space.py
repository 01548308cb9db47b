"""A case in space: what is laid out lies where the world has it, and a page and a picture show it."""

from __future__ import annotations

import base64
import json
import re
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from builders import LIGHTS, box_over_ground
from instancing import COPSE

from shadowbench.errors import UsageError
from shadowbench.inspection import showing, space
from shadowbench.inspection.opening import OpenCase, open_case
from shadowbench.inspection.page import page
from shadowbench.light_space import camera_frame, light_frames
from shadowbench.rows import ResultRow
from shadowbench.world import place

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")


@pytest.fixture(scope="module")
def case(cases: tuple[Path, dict[str, ResultRow]]) -> OpenCase:
    folder, rows = cases
    return open_case(rows["shadow-map"], folder, ())


@pytest.mark.parametrize("light", list(LIGHTS))
def test_unprojecting_undoes_projecting(light: str) -> None:
    world = box_over_ground()
    places = np.random.default_rng(3).random((20, 3))
    for frame in (*light_frames(world.lights[light], world), camera_frame(world.cameras["front"], 40, 30, world)):
        there = frame.project(space.unprojected(frame, places))
        assert there[:, :3] == pytest.approx(places, abs=1e-9)


def test_the_lights_window_holds_the_world(case: OpenCase) -> None:
    arrays, _ = space.laid_out(case)
    low, high = case.seen.world.bounds()
    along = np.asarray(case.seen.light.direction)  # type: ignore[union-attr]
    corners = np.array([(x, y, z) for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])])
    ends = arrays["light_lines"] @ along
    assert ends.min() < (corners @ along).min()
    assert (case.seen.world.vertices @ along).max() < ends.max()


def test_failures_are_painted_in_their_colours(case: OpenCase) -> None:
    arrays, said = space.laid_out(case)
    assert len(arrays["points"]) == case.seen.receivers.count
    legend = {name: (colour, count) for name, colour, count in said["legend"]}
    colour, count = legend["acne"]
    assert count == case.row.acne_count
    painted = (arrays["point_colours"] == list(bytes.fromhex(colour[1:]))).all(axis=1)
    assert np.array_equal(painted, case.measured.masks["acne"])


def test_a_large_scene_is_thinned_evenly(case: OpenCase, monkeypatch: pytest.MonkeyPatch) -> None:
    whole, _ = space.laid_out(case)
    assert len(whole["triangles"]) == case.seen.world.triangle_count
    monkeypatch.setattr(space, "MOST_TRIANGLES", 6)
    monkeypatch.setattr(space, "MOST_POINTS", 100)
    thinned, said = space.laid_out(case)
    assert len(thinned["triangles"]) == 6
    assert said["kept_share"] == 6 / case.seen.world.triangle_count
    failing = int(case.measured.masks["failure"].sum())
    assert failing <= len(thinned["points"]) <= failing + 101


@pytest.mark.parametrize(
    ("counts", "most", "kept"),
    [
        ([2, 12], 100, [2, 12]),
        ([2, 12], 6, [2, 4]),
        ([1000, 2, 1000], 12, [5, 2, 5]),
        ([3, 3, 3, 3], 2, [1, 0, 0, 1]),
        ([7, 7, 8], 21, [7, 7, 7]),
    ],
)
def test_what_is_small_stays_whole_and_what_is_large_shares_alike(
    counts: list[int], most: int, kept: list[int]
) -> None:
    assert space.fair_shares(np.array(counts, np.int64), most).tolist() == kept


def test_instances_are_drawn_without_flattening_and_cover_as_much_as_they_did(
    case: OpenCase, monkeypatch: pytest.MonkeyPatch
) -> None:
    world = place(COPSE().make(COPSE.Parameters()), copied_triangles=-1)
    monkeypatch.setattr("shadowbench.placed_instances.flattened", None)  # nobody may ask for them
    light, camera = next(iter(world.lights.values())), next(iter(world.cameras.values()))
    seen = replace(case.seen, world=world, light=light, camera=camera)
    vertices, triangles, colours, share = space._scene(seen)
    whole = vertices[triangles]
    assert share == 1.0
    assert np.array_equal(whole, np.concatenate([block.corners for block in world.blocks()]))
    assert len(colours) == world.triangle_count

    def area(corners: np.ndarray) -> float:
        a, b, c = (corners[:, k].astype(np.float64) for k in range(3))
        return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum())

    monkeypatch.setattr(space, "MOST_TRIANGLES", world.triangle_count // 2)
    vertices, triangles, _, share = space._scene(seen)
    assert 0.4 < share <= 0.5
    assert area(vertices[triangles]) == pytest.approx(area(whole), rel=0.1)


def test_what_is_there_once_stays_whole_under_many_instances(monkeypatch: pytest.MonkeyPatch) -> None:
    counts, mesh = np.array([40, 30, 40, 40], np.int64), np.array([0, 1, 0, 0])
    monkeypatch.setattr(space, "MOST_TRIANGLES", 60)
    assert space._allowed(counts, mesh).tolist() == [10, 30, 10, 10]


def _parts(text: str) -> tuple[dict[str, Any], dict[str, str]]:
    described, buffers = re.findall(r'<script type="application/json"[^>]*>(.*?)</script>', text, re.DOTALL)
    return json.loads(described), json.loads(buffers)


def test_a_page_holds_the_arrays_and_names_nothing_elsewhere(case: OpenCase) -> None:
    arrays, said = space.laid_out(case)
    text = page(arrays, said | {"title": "</script><b>& x"})
    assert not re.search(r"(?:src|href)=|https?://|url\(|import ", text)
    described, buffers = _parts(text)
    assert described["title"] == "</script><b>& x"
    points = np.frombuffer(base64.b64decode(buffers["points"]), "<f4").reshape(-1, 3)
    assert np.array_equal(points, arrays["points"])


@pytest.mark.skipif(CHROMIUM is None, reason="no Chromium to open the page in")
def test_a_browser_without_a_network_draws_the_page(case: OpenCase, tmp_path: Path) -> None:
    arrays, said = space.laid_out(case)
    file = tmp_path / "view.html"
    showing.show(arrays, said, file)
    command = [
        str(CHROMIUM),
        "--headless=new",
        "--no-sandbox",
        "--use-angle=swiftshader",
        "--enable-unsafe-swiftshader",
    ]
    command += [f"--user-data-dir={tmp_path / 'profile'}", "--host-resolver-rules=MAP * ~NOTFOUND"]
    command += ["--virtual-time-budget=3000", "--dump-dom", file.as_uri()]
    done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=120)
    body = re.search(r"<body[^>]*>", done.stdout)
    assert body is not None
    indices, points = 3 * len(arrays["triangles"]), len(arrays["points"])
    ends = len(arrays["light_lines"]), len(arrays["camera_lines"])
    assert f'data-drawn="{indices} {points} {ends[0]} {ends[1]} 1"' in body[0]
    assert 'data-errors="0"' in body[0]
    for name, _, count in said["legend"]:
        assert f"{name.replace('_', ' ')} ({count:,})" in done.stdout


def test_a_picture_is_drawn_by_a_child_process(case: OpenCase, tmp_path: Path) -> None:
    from PIL import Image

    file = tmp_path / "view.png"
    try:
        showing.must_be_possible(file)
    except UsageError as error:
        pytest.skip(str(error))
    showing.show(*space.laid_out(case), file)
    with Image.open(file) as image:
        colours = {colour for _, colour in image.convert("RGB").getcolors(1 << 20) or []}
    assert (0, 114, 178) in colours  # acne


def test_what_cannot_be_drawn_is_one_line_with_its_remedy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    with pytest.raises(UsageError, match=r"-o view\.png"):
        showing.must_be_possible(None)
    with pytest.raises(UsageError, match=r"\.png, \.jpg or \.html"):
        showing.must_be_possible(Path("view.gif"))
    monkeypatch.setattr(showing.ctypes.util, "find_library", lambda _: None)
    with pytest.raises(UsageError, match="libegl1"):
        showing.must_be_possible(Path("view.png"))
    showing.must_be_possible(Path("view.html"))


def test_a_child_that_dies_is_told_in_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def died(*_: Any, **__: Any) -> Any:
        return subprocess.CompletedProcess([], -11, "", "")

    monkeypatch.setattr(showing.subprocess, "run", died)
    with pytest.raises(UsageError, match="signal 11"):
        showing.show({"points": np.zeros(3)}, {}, tmp_path / "view.png")
    monkeypatch.setattr(
        showing.subprocess,
        "run",
        lambda *_, **__: subprocess.CompletedProcess([], 1, "", "trace\nValueError: odd\n"),
    )
    with pytest.raises(UsageError, match="ValueError: odd"):
        showing.show({"points": np.zeros(3)}, {}, tmp_path / "view.png")
