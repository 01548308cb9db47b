"""Accounts of single receivers: their last number is what shade() wrote, and their numbers make it up."""

from __future__ import annotations

import json
from functools import cache
from typing import Any

import numpy as np
import pytest
from accounts import CONFIGURATIONS, differences, shaded, spread
from builders import LIGHTS, box_over_ground, windows_over_ground
from instancing import COPSE

from shadowbench.account import Account, Step, number
from shadowbench.camera_pass import render
from shadowbench.contract import account_breaches
from shadowbench.method import Context, Method
from shadowbench.receivers import Receivers
from shadowbench.world import World, place


@cache
def _box() -> tuple[World, Receivers]:
    world = box_over_ground(lift=0.1)
    return world, render(world, world.cameras["front"], 48, 36, Context())


@cache
def _windows() -> tuple[World, Receivers]:
    world = windows_over_ground()
    return world, render(world, world.cameras["front"], 48, 36, Context())


def _asked(
    name: str, values: dict[str, Any], light: str, *, windows: bool = False, count: int = 8
) -> list[tuple[Account, Any, int]]:
    """Return accounts of all kinds of receivers, what shade() wrote for each, and their numbers."""
    world, receivers = _windows() if windows else _box()
    found = shaded(name, values, world, receivers, light)
    if isinstance(found, str):
        pytest.skip(found)
    method, visibility = found
    told = []
    for index in spread(visibility, receivers, count):
        account = method.account(receivers, index)
        assert account is not None
        told.append((account, visibility[index], index))
    return told


@pytest.mark.parametrize("light", list(LIGHTS))
@pytest.mark.parametrize(("name", "values"), CONFIGURATIONS, ids=str)
def test_an_account_ends_in_the_visibility_that_shade_wrote(name: str, values: dict[str, Any], light: str) -> None:
    for account, written, _index in _asked(name, values, light):
        assert differences(account, written) <= account.rounding
        json.dumps(account.as_json(), allow_nan=False)


@pytest.mark.parametrize("light", list(LIGHTS))
@pytest.mark.parametrize("name", ["instanced", "afsm", "irregular-z-buffer", "ray-traced"])
def test_it_does_so_by_channel_through_turned_translucent_casters(name: str, light: str) -> None:
    told = _asked(name, {}, light, windows=True, count=20)
    assert {len(np.atleast_1d(account.visibility)) for account, _, _ in told} == {3}
    assert any(0.0 < channel < 1.0 for account, _, _ in told for channel in np.atleast_1d(account.visibility))
    for account, written, _index in told:
        assert differences(account, written) == 0.0


def _step(account: Account, title: str) -> Step | None:
    return next((step for step in account.steps if step.title == title), None)


def _values(step: Step) -> dict[str, Any]:
    return {quantity.name: quantity.value for quantity in step.quantities}


def test_a_shadow_maps_account_compares_the_depths_it_states() -> None:
    for account, written, _index in _asked("shadow-map", {"resolution": 64}, "sun"):
        step = _step(account, "comparison")
        assert step is not None
        said = _values(step)
        assert float(said["receiver depth"] - said["bias"] <= said["stored depth"]) == written


@pytest.mark.parametrize("values", [{"filter": "gauss", "kernel": 5}, {"filter": "bilinear"}, {"footprint": "pixel"}])
def test_the_taps_of_percentage_closer_filtering_add_up(values: dict[str, Any]) -> None:
    for account, written, _index in _asked("pcf", {"resolution": 64, **values}, "sun"):
        step = _step(account, "weighted mean of depth tests")
        assert step is not None
        assert step.table is not None
        columns = dict(zip(step.table.columns, np.array(step.table.rows, dtype=np.float64).T, strict=True))
        lit, weight = columns["lit"], columns["weight"]
        assert np.array_equal(lit, columns["compared depth"] <= columns["stored depth"])
        assert weight.sum() == pytest.approx(1.0, abs=1e-6)
        assert (weight * lit).sum() == pytest.approx(written, abs=1e-6)


@pytest.mark.parametrize("filtering", ["bilinear", "trilinear", "anisotropic"])
def test_the_mean_moments_are_those_of_the_texels_under_the_footprint(filtering: str) -> None:
    for account, _, _index in _asked("vsm", {"resolution": 64, "filtering": filtering}, "sun"):
        texels, bound = account.steps[-2].table, _step(account, "Chebyshev's bound")
        assert texels is not None
        assert bound is not None
        rows = np.array(texels.rows, dtype=np.float64)
        weight, moments = rows[:, 2], rows[:, 3:]
        assert weight.sum() == pytest.approx(1.0, abs=1e-6)
        said = _values(bound)
        assert weight @ moments == pytest.approx([said["M1, mean depth"], said["M2, mean square"]], abs=1e-6)
        d, mean = said["receiver depth d, less the bias"], said["M1, mean depth"]
        variance = said["variance, at least minimum_variance"]
        expected = 1.0 if d <= mean else variance / (variance + (d - mean) ** 2)
        assert account.visibility == pytest.approx(expected, abs=1e-5)


def test_the_terms_of_the_fourier_series_add_up() -> None:
    for basis in ("8-bit", "float"):
        for account, written, _index in _asked("csm", {"resolution": 64, "basis": basis}, "sun"):
            step = _step(account, "Fourier series of the depth test")
            assert step is not None
            series = 0.5 + _values(step)["sum of the terms"]
            assert min(max(series, 0.0), 1.0) == pytest.approx(written, abs=2e-5)


def test_an_exponential_test_is_the_product_it_states() -> None:
    for account, written, _index in _asked("esm", {"resolution": 64, "classification": "none", "c": 40.0}, "sun"):
        step, texels = _step(account, "exponential test"), account.steps[-2].table
        assert step is not None
        assert texels is not None
        said, rows = _values(step), np.array(texels.rows, dtype=np.float64)
        mean = rows[:, 2] @ rows[:, 3]
        assert mean == pytest.approx(said["mean of e^(c z)"], rel=1e-4)
        expected = min(1.0, mean * np.exp(-40.0 * said["receiver depth d, less the bias"]))
        assert expected == pytest.approx(written, rel=1e-3, abs=1e-6)


def test_an_exact_accounts_crossed_triangles_are_those_of_a_ray_in_numpy() -> None:
    world, receivers = _box()
    corners = world.vertices[world.triangles].astype(np.float64)
    towards = np.asarray(world.lights["sun"].direction)  # type: ignore[union-attr]
    for account, written, index in _asked("afsm", {}, "sun"):
        step = _step(account, "triangles that cover the receiver")
        if step is None:
            continue
        assert step.table is not None
        crossed = {(row[1], row[2]) for row in step.table.rows if row[5] == "crossed"}
        assert (not crossed) == bool(written)
        origin = receivers.position[index].astype(np.float64)
        for instance, triangle in crossed:
            a, b, c = corners[int(world.first_triangle[instance]) + triangle]
            s, t, distance = np.linalg.solve(np.stack([b - a, c - a, -towards], axis=1), origin - a)
            assert s >= -1e-6
            assert t >= -1e-6
            assert s + t <= 1.0 + 1e-6
            assert distance > 0.0


def test_exact_accounts_of_instances_need_no_flat_triangles(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = COPSE().make(COPSE.Parameters())
    world = place(scene, copied_triangles=-1)
    assert not world.is_flat
    receivers = render(world, next(iter(world.cameras.values())), 40, 30, Context())
    monkeypatch.setattr("shadowbench.placed_instances.flattened", None)  # nobody may ask for them
    light = next(iter(world.lights))
    for name in ("ray-traced", "afsm"):
        found = shaded(name, {}, world, receivers, light)
        assert not isinstance(found, str)
        method, visibility = found
        for index in spread(visibility, receivers, 6):
            account = method.account(receivers, index)
            assert account is not None
            assert differences(account, visibility[index]) == 0.0


def test_one_receiver_alone_is_that_receiver() -> None:
    _, receivers = _box()
    index = receivers.count // 2
    alone = receivers.only(index)
    assert alone.count == 1
    assert np.array_equal(alone.position[0], receivers.position[index])
    pixel = int(receivers.pixel[index])
    assert (alone.first_of_pixel[pixel], alone.first_of_pixel[pixel + 1]) == (0, 1)
    assert alone.first_of_pixel[-1] == 1
    assert len(alone.first_of_pixel) == len(receivers.first_of_pixel)


def test_the_contract_wants_an_account_to_end_in_what_was_written() -> None:
    written = np.float32(0.25)
    good = Account((Step("a step"),), 0.25)
    assert list(account_breaches(None, written)) == []
    assert list(account_breaches(good, written)) == []
    assert list(account_breaches(Account((), 0.2502, rounding=1e-3), written)) == []
    (differs,) = account_breaches(Account((), 0.5), written)
    assert "0.5" in differs
    assert "0.25" in differs
    (rounds,) = account_breaches(Account((), 0.25, rounding=0.1), written)
    assert "rounding" in rounds
    (shape,) = account_breaches(Account((), (0.25, 0.25, 0.25)), written)
    assert "visibility" in shape
    (no_account,) = account_breaches({"visibility": 0.25}, written)
    assert "dict" in no_account
    (not_plain,) = account_breaches(Account((Step(np.float64(1.0) * 0 + np.ones(2)),), 0.25), written)  # type: ignore[arg-type]
    assert "plain" in not_plain


def test_a_method_need_not_tell_an_account() -> None:
    assert Method.account(object.__new__(type("Quiet", (Method,), {"build": None, "shade": None})), None, 0) is None  # type: ignore[arg-type]


def test_numbers_in_formulas_keep_float32s_digits() -> None:
    assert number(0.1) == "0.1"
    assert float(number(float(np.float32(0.123456789)))) == pytest.approx(np.float32(0.123456789), rel=1e-7)
