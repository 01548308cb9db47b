"""Exact PCF on a map: equal to PCF where PCF is exact, to NumPy elsewhere, and close to the truth on a fine map."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from builders import box_over_ground
from numpy.typing import NDArray
from running import REGISTRY, run_method

from shadowbench.camera_pass import render
from shadowbench.device.launch import Context
from shadowbench.device.percentage_closer import percentage_closer
from shadowbench.device.shadow_lookup import light_maps
from shadowbench.filtered_reference import filtered_reference
from shadowbench.light_space import camera_frame, light_frames
from shadowbench.light_space_kernel import LightSpaceKernel
from shadowbench.method import Changes, Trace, View
from shadowbench.reference import hard_reference

WORLD = box_over_ground()
RECEIVERS = render(WORLD, WORLD.cameras["front"], 120, 90, Context())
FLAT = (RECEIVERS.normal[:, 1] > 0.5) & (np.abs(RECEIVERS.position[:, [0, 2]]) < 2.0).all(axis=1)
"""Receivers on the ground and on the box, away from where the windows end."""

FLUSH = {"receiver_plane": True, "slope_bias": 0.0, "bias": 1e-4}
"""Parameters of `pcf` with which it too tests the receiver's plane."""


def on_map(light: str, kernel: LightSpaceKernel, *, threads: int = 1, **values: Any) -> NDArray[np.float32]:
    """Exact PCF on the map that ``pcf`` draws."""
    _, trace = run_method("pcf", WORLD, RECEIVERS, light=light, **(FLUSH | values))
    frames = light_frames(WORLD.lights[light], WORLD)
    maps = light_maps(WORLD.lights[light], frames, trace.kept["shadow map"])
    return percentage_closer(maps, RECEIVERS, kernel, 1e-4, Context(threads=threads))


@pytest.mark.parametrize("light", ["sun", "spot", "lamp"])
@pytest.mark.parametrize(
    "values", [{"kernel": 3}, {"kernel": 4}, {"kernel": 7}, {"filter": "bilinear"}], ids=["3", "4", "7", "bilinear"]
)
def test_a_box_of_whole_texels_and_a_tent_are_pcf_itself(light, values):
    by_pcf, _ = run_method("pcf", WORLD, RECEIVERS, light=light, resolution=600, **FLUSH, **values)
    kernel = LightSpaceKernel(values.get("filter", "box"), float(values.get("kernel", 2)), 600)
    exact = on_map(light, kernel, resolution=600)
    # pcf bounds a plane's slope, on walls; and under a spot or point light it takes the slope at the receiver for all
    compared = np.ones(RECEIVERS.count, bool) if light == "sun" else FLAT
    assert (np.abs(by_pcf - exact) > 1e-6)[compared].sum() <= 2  # within rounding of a texel's border
    assert 0.0 < by_pcf.mean() < 1.0


@pytest.mark.parametrize("light", ["sun", "spot"])
def test_a_gauss_is_the_mean_of_tests_of_the_plane_weighted_at_the_texels_centres(light):
    exact = on_map(light, LightSpaceKernel("gauss", 5.0, 150, 1.1), resolution=150)
    _, trace = run_method("pcf", WORLD, RECEIVERS, light=light, resolution=150, **FLUSH)
    depth = trace.kept["shadow map"].numpy()[0]
    (frame,) = light_frames(WORLD.lights[light], WORLD)
    truth = hard_reference(WORLD, RECEIVERS, WORLD.lights[light], Context())
    x, y = frame.project(RECEIVERS.position)[:, :2].T * 150.0
    inside = truth.in_field & (np.minimum(x, y) > 3.0) & (np.maximum(x, y) < 147.0)
    partly = 0
    for i in np.flatnonzero(inside)[::29]:
        lit = total = 0.0
        for row in range(int(y[i]) - 3, int(y[i]) + 4):
            for column in range(int(x[i]) - 3, int(x[i]) + 4):
                u, v = column + 0.5, row + 0.5
                if max(abs(u - x[i]), abs(v - y[i])) > 2.5:
                    continue
                weight = np.exp(-((u - x[i]) ** 2 + (v - y[i]) ** 2) / (2.0 * 1.1**2))
                total += weight
                lit += weight * (_depth_of_plane(frame, u / 150.0, v / 150.0, i) - 1e-4 <= depth[row, column])
        assert exact[i] == pytest.approx(lit / total, abs=1e-5)
        partly += 0.0 < exact[i] < 1.0
    assert partly > 10


def _depth_of_plane(frame, u, v, i):
    """Depth where the ray through (u, v) meets a receiver's plane, by three linear equations; 1 beyond the horizon."""
    n, p = RECEIVERS.normal[i].astype(float), RECEIVERS.position[i].astype(float)
    rows = frame.projection[[0, 1]] - np.outer((u, v), frame.projection[3])
    point = np.linalg.solve(np.vstack([rows[:, :3], n]), np.append(-rows[:, 3], n @ p))
    _, _, depth, w = frame.projection @ np.append(point, 1.0)
    return min(depth, 1.0) if w > 0.0 else 1.0


def test_threads_do_not_change_a_bit():
    kernel = LightSpaceKernel("gauss", 5.0, 150, 1.1)
    np.testing.assert_array_equal(on_map("lamp", kernel), on_map("lamp", kernel, threads=2))


def test_a_kernel_narrower_than_a_texel_is_the_holding_texels_test():
    nearest, _ = run_method("shadow-map", WORLD, RECEIVERS, resolution=600, **FLUSH)
    found = on_map("sun", LightSpaceKernel("box", 1e-3, 600), resolution=600)
    assert (found != nearest).sum() <= 2


@pytest.mark.parametrize("light", ["sun", "spot", "lamp"])
def test_on_finer_maps_it_approaches_the_filtered_truth(light):
    kernel = LightSpaceKernel("box", 8.0, 128)
    truth, scored = _truth(light, kernel)
    errors = []
    for resolution in (64, 128, 256, 512, 1024):
        found = on_map(light, kernel, resolution=resolution, bias=1e-5)
        errors.append(float(np.sqrt(np.mean((found - truth)[scored] ** 2))))
    assert all(after < 0.7 * before for before, after in pairwise(errors)), errors
    assert errors[-1] < 0.003


def test_pcf_with_a_window_of_the_same_width_in_the_world_approaches_it_too():
    kernel = LightSpaceKernel("box", 2.0, 64)
    truth, scored = _truth("sun", kernel)
    errors = []
    for finer in (1, 2, 4, 8, 16):
        found, _ = run_method("pcf", WORLD, RECEIVERS, resolution=64 * finer, kernel=2 * finer, **FLUSH)
        errors.append(float(np.sqrt(np.mean((found - truth)[scored & FLAT] ** 2))))
    assert all(after < 0.75 * before for before, after in pairwise(errors)), errors
    assert errors[-1] < 0.005


def _truth(light, kernel):
    placed = WORLD.lights[light]
    hard = hard_reference(WORLD, RECEIVERS, placed, Context())
    truth = filtered_reference(WORLD, RECEIVERS, placed, hard, kernel, Context(threads=2), point_count=1024)
    return truth.visibility, RECEIVERS.valid & hard.in_field & ~hard.turned_away


def test_a_depth_map_method_answers_with_its_own_map_and_kernel_after_build():
    cls = REGISTRY.method("pcf")
    method = cls(cls.Parameters(filter="gauss", kernel=5, resolution=150, **FLUSH), Context())
    camera = WORLD.cameras["front"]
    view = View(camera, 120, 90, camera_frame(camera, 120, 90, WORLD))
    method.build(WORLD.casters, WORLD.lights["sun"], view, Changes(True, frozenset((0, 1)), True), Trace())
    found = method.exact_on_map(RECEIVERS)
    expected = on_map("sun", method.kernel(RECEIVERS), resolution=150)
    np.testing.assert_array_equal(found, expected)
    hard = REGISTRY.method("shadow-map")
    assert hard(hard.Parameters(), Context()).exact_on_map(RECEIVERS) is None
