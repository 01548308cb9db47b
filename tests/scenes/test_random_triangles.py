"""The random-triangle scene: the same bits every time, constant area, fair attitudes, and the paper's view of it."""

from __future__ import annotations

import hashlib

import numpy as np
import pytest
from numpy.typing import NDArray
from tracing import shaded

from shadowbench.camera_pass import render
from shadowbench.device.launch import Context
from shadowbench.errors import ParameterError
from shadowbench.methods.afsm import AliasFreeShadowMaps
from shadowbench.parameters import parse_parameters
from shadowbench.scene import DirectionalLight, PointLight, Scene, SpotLight
from shadowbench.scenes.random_triangles import GROUND_GAP, TOTAL_AREA, RandomTriangles, random_triangles
from shadowbench.world import place


def _make(**values: object) -> Scene:
    return RandomTriangles().make(RandomTriangles.Parameters(**values))


def _soup(scene: Scene) -> NDArray[np.float64]:
    mesh = scene.meshes[0]
    return mesh.vertices[mesh.triangles].astype(np.float64)


def _digest(scene: Scene) -> str:
    return hashlib.sha256(b"".join(m.vertices.tobytes() + m.triangles.tobytes() for m in scene.meshes)).hexdigest()


def _areas(soup: NDArray[np.float64]) -> NDArray[np.float64]:
    cross = np.cross(soup[:, 1] - soup[:, 0], soup[:, 2] - soup[:, 0])
    return np.linalg.norm(cross, axis=1) / 2.0


def test_the_same_seed_gives_the_same_bits_whatever_was_drawn_elsewhere() -> None:
    before = _digest(_make(triangles=1234, seed=7))
    np.random.default_rng(7).random(10)
    assert _digest(_make(triangles=1234, seed=7)) == before
    assert _digest(_make(triangles=1234, seed=8)) != before


@pytest.mark.parametrize("count", [1_000, 10_000, 100_000])
def test_the_total_area_does_not_depend_on_the_number(count: int) -> None:
    scene = _make(triangles=count)
    assert scene.meshes[0].triangle_count == count
    assert _areas(_soup(scene)).sum() == pytest.approx(TOTAL_AREA, rel=1e-5)


def test_triangles_are_equilateral_and_of_one_size() -> None:
    soup = _soup(_make(triangles=500, area=3.0))
    side = np.linalg.norm(soup - np.roll(soup, 1, axis=1), axis=2)
    np.testing.assert_allclose(side, np.sqrt(3.0 / 500 * 4.0 / np.sqrt(3.0)), rtol=1e-5)


@pytest.mark.parametrize("count", [1, 20, 1_000, 100_000])
def test_no_triangle_pierces_the_ground(count: int) -> None:
    assert _soup(_make(triangles=count))[:, :, 1].min() >= GROUND_GAP * 0.999


def test_centres_fill_the_box_evenly() -> None:
    centres = _soup(_make(triangles=100_000)).mean(axis=1)
    low, high = centres.min(axis=0), centres.max(axis=0)
    np.testing.assert_allclose(low, [-1.0, 0.01, -1.0], atol=0.01)
    np.testing.assert_allclose(high, [1.0, 1.0, 1.0], atol=0.01)
    # the mean of n uniform draws from a span s has the deviation s / sqrt(12 n); five of them
    np.testing.assert_allclose(centres.mean(axis=0), (low + high) / 2.0, atol=5.0 * 2.0 / np.sqrt(12.0 * 100_000))


def test_attitudes_are_uniform_over_all_rotations() -> None:
    soup = _soup(_make(triangles=100_000))
    first = soup[:, 0] - soup.mean(axis=1)
    normal = np.cross(soup[:, 1] - soup[:, 0], soup[:, 2] - soup[:, 0])
    for direction in (first, normal):
        unit = direction / np.linalg.norm(direction, axis=1, keepdims=True)
        # isotropic: mean 0 and second moments 1/3 of the identity; deviations are below 0.6 / sqrt(n)
        np.testing.assert_allclose(unit.mean(axis=0), 0.0, atol=5.0 * 0.6 / np.sqrt(100_000))
        np.testing.assert_allclose(unit.T @ unit / 100_000, np.eye(3) / 3.0, atol=5.0 * 0.3 / np.sqrt(100_000))


def test_consecutive_triangles_are_unrelated() -> None:
    centres = _soup(_make(triangles=100_000)).mean(axis=1)[:, 0]
    assert abs(np.corrcoef(centres[1:], centres[:-1])[0, 1]) < 5.0 / np.sqrt(100_000)


@pytest.mark.parametrize("name", ["middle", "zoom-in"])
def test_every_pixel_of_the_papers_view_sees_a_surface(name: str) -> None:
    scene = _make(triangles=1)
    camera, half = scene.cameras[name], 8.0 / 2.0
    eye, forward = np.array(camera.eye), np.subtract(camera.target, camera.eye)
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, camera.up)
    right /= np.linalg.norm(right)
    tangent = np.tan(np.radians(camera.vertical_angle) / 2.0)
    for x in (-1.0, 1.0):
        for y in (-1.0, 1.0):
            ray = forward + tangent * (1024 / 768 * x * right + y * np.cross(right, forward))
            ground = eye - ray * eye[1] / ray[1]
            assert ray[1] < 0.0
            assert np.abs(ground[[0, 2]]).max() < half


def test_the_default_view_and_light_are_the_papers() -> None:
    scene = _make()
    assert scene.triangle_count == 10_002
    assert list(scene.cameras) == ["middle", "zoom-out", "zoom-in"]
    assert list(scene.lights) == ["sun", "spot", "lamp"]


def test_the_lamp_hangs_among_the_triangles_and_the_spot_stands_outside() -> None:
    scene = _make()
    lamp, spot = scene.lights["lamp"], scene.lights["spot"]
    assert isinstance(lamp, PointLight)
    assert isinstance(spot, SpotLight)
    soup = _soup(scene)
    low, high = soup.min(axis=(0, 1)), soup.max(axis=(0, 1))
    assert (low < lamp.position).all()
    assert (lamp.position < high).all()
    assert spot.position[1] > high[1]


def test_the_ground_receives_and_faces_up_and_has_nothing_below_it_to_cast_on() -> None:
    scene = _make(ground=10.0)
    ground = scene.meshes[1]
    assert [(i.casts, i.receives) for i in scene.instances] == [(True, True), (False, True)]
    a, b, c = ground.vertices[ground.triangles[0]]
    assert np.cross(b - a, c - a)[1] > 0.0
    assert _areas(ground.vertices[ground.triangles]).sum() == pytest.approx(100.0)


def test_no_two_of_many_triangles_are_the_same() -> None:
    soup = random_triangles(200_000, 3, TOTAL_AREA).vertices.reshape(-1, 9)
    assert len(np.unique(soup, axis=0)) == 200_000


@pytest.mark.parametrize("values", [{"triangles": 0}, {"triangles": 4_000_001}, {"area": 0.0}, {"seed": -1}])
def test_parameters_outside_their_range_are_refused(values: dict[str, object]) -> None:
    with pytest.raises(ParameterError, match=next(iter(values))):
        parse_parameters(RandomTriangles.Parameters, values, owner="scene 'random-triangles'")


def _points_tested(triangles: int) -> int:
    """Sampling points tested in Table 1's view, by brute force over the candidates of a grid in the sun's plane.

    Each point that is turned to the sun and not yet in shadow counts once for each triangle, other than its own and
    the ground's two, that covers it as seen from the sun; the triangles come in order.
    """
    world = place(_make(triangles=triangles))
    receivers = render(world, world.cameras["middle"], 1024, 768, Context())
    sun = world.lights["sun"]
    assert isinstance(sun, DirectionalLight)
    towards = np.array(sun.direction)
    side = np.cross(towards, [0.0, 1.0, 0.0])
    axes = np.stack([side / np.linalg.norm(side), np.cross(towards, side / np.linalg.norm(side)), towards], axis=1)
    corners = world.vertices[world.triangles].astype(np.float64)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    eye_side = ((np.array(receivers.eye) - corners[:, 0]) * normal).sum(axis=1) > 0.0
    is_turned_to = (normal @ towards > 0.0) == eye_side

    point = receivers.position.astype(np.float64) @ axes
    kept = is_turned_to[receivers.triangle]
    point, own = point[kept], receivers.triangle[kept]
    cells = 512
    low, size = point[:, :2].min(axis=0), np.ptp(point[:, :2], axis=0)
    column, row = np.clip(((point[:, :2] - low) / size * cells).astype(int), 0, cells - 1).T
    order = np.argsort(row * cells + column, kind="stable")
    point, own = point[order], own[order]
    first = np.searchsorted((row * cells + column)[order], np.arange(cells * cells + 1))

    seen = corners[:triangles] @ axes
    lowest, highest = seen[..., :2].min(axis=1), seen[..., :2].max(axis=1)
    low_cell, high_cell = (
        ((bounds - low) / size * cells).astype(int).clip(0, cells - 1) for bounds in (lowest, highest)
    )
    may_cover = np.flatnonzero(((lowest <= low + size) & (highest >= low)).all(axis=1))

    tested, first_shadowing = 0, np.full(len(point), triangles)
    for some in np.array_split(may_cover, 1 + len(may_cover) // 5000):
        (left, top), (right, bottom) = low_cell[some].T, high_cell[some].T
        span, row = _ranges(top, bottom + 1)
        begin, end = first[row * cells + left[span]], first[row * cells + right[span] + 1]
        within, near = _ranges(begin, end)
        t = some[span[within]]
        t, near = t[own[near] != t], near[own[near] != t]
        a, b, c = seen[t].transpose(1, 2, 0)
        x, y, depth = point[near].T
        area = np.array([(q[0] - p[0]) * (y - p[1]) - (q[1] - p[1]) * (x - p[0]) for p, q in ((b, c), (c, a), (a, b))])
        covers = (np.sign(area) >= 0).all(axis=0) | (np.sign(area) <= 0).all(axis=0)
        t, near, area = t[covers], near[covers], area[:, covers]
        is_nearer = (area * seen[t, :, 2].T).sum(axis=0) / area.sum(axis=0) > depth[covers]
        np.minimum.at(first_shadowing, near[is_nearer], t[is_nearer])
        tested += int((t <= first_shadowing[near]).sum())
    return tested


def _ranges(begin: NDArray[np.int64], end: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the numbers of all ranges one after the other, behind the number of the range that each is in."""
    length = end - begin
    which = np.repeat(np.arange(len(length)), length)
    return which, np.arange(len(which)) + (begin - np.cumsum(length) + length)[which]


def test_as_many_points_are_tested_for_1000_triangles_as_in_the_paper() -> None:
    """And the method's counter tells the same number, but for points on the very edge of a triangle."""
    tested = _points_tested(1000)
    assert tested == pytest.approx(458_000, rel=0.05)
    world = place(_make(triangles=1000))
    receivers = render(world, world.cameras["middle"], 1024, 768, Context())
    method = AliasFreeShadowMaps(AliasFreeShadowMaps.Parameters(), Context())
    _, trace = shaded(method, world, world.lights["sun"], receivers)
    method.explain(receivers, trace)
    assert trace.counters["sampling points tested"] == pytest.approx(tested, rel=1e-3)
    assert trace.counters["2D BSP nodes"] == 16_384


@pytest.mark.slow
@pytest.mark.parametrize(("triangles", "printed"), [(10_000, 513_000), (100_000, 506_000)])
def test_the_papers_counts_for_more_triangles_are_predicted(triangles: int, printed: int) -> None:
    assert _points_tested(triangles) == pytest.approx(printed, rel=0.1)
