"""The hair ball: the paper's count of triangles, the same bits every time, and hairs that are tubes within a ball."""

from __future__ import annotations

import hashlib

import numpy as np
import pytest
from numpy.typing import NDArray

from shadowbench.camera_pass import render
from shadowbench.device.launch import Context
from shadowbench.errors import ParameterError
from shadowbench.parameters import parse_parameters
from shadowbench.scene import PointLight, Scene
from shadowbench.scenes.hair_ball import CENTRE, HAIR_LENGTH, SIDES, HairBall, hair_tubes
from shadowbench.scenes.tubes import tube_triangles
from shadowbench.world import place


def _make(**values: object) -> Scene:
    return HairBall().make(HairBall.Parameters(**values))


def _digest(scene: Scene) -> str:
    return hashlib.sha256(b"".join(m.vertices.tobytes() + m.triangles.tobytes() for m in scene.meshes)).hexdigest()


def _centre_lines(hairs: int, segments: int, seed: int = 1) -> NDArray[np.float64]:
    """Centres of the rings, from tubes so thin that float32 hides it: shape [hairs, segments + 1, 3]."""
    return hair_tubes(hairs, segments, 0.0, seed)[:, :, 0].astype(np.float64)


def test_the_default_ball_has_the_papers_number_of_triangles() -> None:
    scene = _make()
    hairs, ground = scene.meshes[:-1], scene.meshes[-1]
    assert sum(mesh.triangle_count for mesh in hairs) == 2_880_000 == 5000 * 576
    assert ground.triangle_count == 2
    assert scene.triangle_count == 2_880_002


@pytest.mark.parametrize(("hairs", "segments"), [(1, 24), (3, 25), (7, 40), (123, 24)])
def test_smaller_balls_have_six_triangles_a_segment(hairs: int, segments: int) -> None:
    scene = _make(hairs=hairs, segments=segments)
    assert scene.triangle_count == 6 * hairs * segments + 2
    assert len(scene.instances) == len(scene.meshes) == min(hairs, 5) + 1


def test_the_same_seed_gives_the_same_bits_whatever_was_drawn_elsewhere() -> None:
    before = _digest(_make(hairs=50, seed=7))
    np.random.default_rng(7).random(10)
    assert _digest(_make(hairs=50, seed=7)) == before
    assert _digest(_make(hairs=50, seed=8)) != before


@pytest.mark.parametrize(("segments", "seed"), [(24, 1), (96, 1), (96, 2), (200, 3)])
def test_hairs_fill_a_ball_above_the_ground(segments: int, seed: int) -> None:
    points = hair_tubes(2000, segments, 0.002, seed).reshape(-1, 3).astype(np.float64)
    distance = np.linalg.norm(points - CENTRE, axis=1)
    assert distance.max() < CENTRE[1]
    assert points[:, 1].min() > 0.0
    # no cap and no hole: the rim is reached in every direction, and the ball's centre of mass is its centre
    low, high = points.min(axis=0) - CENTRE, points.max(axis=0) - CENTRE
    assert high.min() > 0.9
    assert low.max() < -0.9
    np.testing.assert_allclose(points.mean(axis=0), CENTRE, atol=0.03)


@pytest.mark.parametrize("segments", [48, 96, 200])
def test_a_hair_has_its_length_and_moves_steadily(segments: int) -> None:
    step = np.linalg.norm(np.diff(_centre_lines(200, segments), axis=1), axis=2)
    # a chord is shorter than its arc by no more than (angle / 2)² / 6, and no hair turns by more than 16 a unit
    longest_angle = 16.0 * HAIR_LENGTH / segments
    assert step.max() < HAIR_LENGTH / segments * 1.0001
    assert step.min() > HAIR_LENGTH / segments * (1.0 - longest_angle**2 / 8.0)


def test_finer_hairs_are_the_same_hairs() -> None:
    """The integration is of second order: halving the step quarters the difference."""
    coarse, middle, fine = (_centre_lines(200, n) for n in (50, 100, 200))
    first = np.linalg.norm(coarse - middle[:, ::2], axis=2)[:, :20]
    second = np.linalg.norm(middle[:, ::2] - fine[:, ::4], axis=2)[:, :20]
    assert np.median(first[:, 1:] / second[:, 1:]) == pytest.approx(4.0, rel=0.1)


def test_hairs_are_tubes_that_taper_from_root_to_tip() -> None:
    tubes = hair_tubes(100, 40, 0.01, 3).astype(np.float64)
    centre = tubes.mean(axis=2, keepdims=True)
    radius = np.linalg.norm(tubes - centre, axis=3)
    expected = 0.01 * (1.0 - 0.75 * np.arange(41) / 40)
    np.testing.assert_allclose(radius, np.broadcast_to(expected[None, :, None], radius.shape), atol=1e-6)
    np.testing.assert_allclose(np.linalg.norm(tubes - np.roll(tubes, 1, axis=2), axis=3), np.sqrt(3.0) * radius, 1e-3)


def test_tubes_face_out_and_are_closed_along_their_length() -> None:
    hairs, rings = 4, 25
    triangles = tube_triangles(hairs, rings, SIDES)
    tubes = hair_tubes(hairs, rings - 1, 0.001, 5).astype(np.float64)
    corners = tubes.reshape(-1, 3)[triangles]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    axis = np.repeat(tubes.mean(axis=2).reshape(-1, 3), 3, axis=0)[triangles].mean(axis=1)
    assert ((corners.mean(axis=1) - axis) * normal).sum(axis=1).min() > 0.0
    edges = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    directed = {tuple(edge) for edge in edges.tolist()}
    assert len(directed) == len(edges), "no edge is run through twice in one direction"
    open_edges = [edge for edge in directed if edge[::-1] not in directed]
    assert len(open_edges) == 2 * 3 * hairs, "only the two ends of each tube are open"


def test_hairs_let_nine_tenths_through_and_the_groups_dye_the_light_differently() -> None:
    scene = _make(hairs=10, segments=24)
    hairs, ground = scene.instances[:-1], scene.instances[-1]
    assert ground.transmittance == (0.0, 0.0, 0.0)
    for hair in hairs:
        assert np.mean(hair.transmittance) == pytest.approx(0.9)
    assert len({hair.transmittance for hair in hairs}) == len(hairs)


@pytest.mark.parametrize("opacity", [1e-3, 0.05, 0.5, 0.97, 1.0])
def test_every_opacity_is_kept_on_average_over_the_colours(opacity: float) -> None:
    for hair in _make(hairs=10, segments=24, opacity=opacity).instances[:-1]:
        assert np.mean(hair.transmittance) == pytest.approx(1.0 - opacity, abs=1e-12)


def test_cameras_see_the_ball_and_the_lamp_hangs_within_the_scene() -> None:
    scene = _make(hairs=200, segments=24)
    world = place(scene)
    assert list(scene.lights) == ["sun", "spot", "lamp"]
    lamp = world.lights["lamp"]
    assert isinstance(lamp, PointLight)
    low, high = world.bounds()
    assert (low < lamp.position).all()
    assert (lamp.position < high).all()
    for camera in world.cameras.values():
        receivers = render(world, camera, 96, 68, Context())
        assert (receivers.instance < 5).mean() > 0.05
    figure = render(world, world.cameras["figure"], 96, 68, Context())
    ball = figure.pixel[figure.instance < 5]
    columns, rows = ball % 96, ball // 96
    assert 0 < columns.min() < columns.max() < 95, "all of the ball is in the figure's picture"
    assert 0 < rows.min() < rows.max() < 67


@pytest.mark.parametrize("values", [{"hairs": 0}, {"segments": 23}, {"opacity": 0.0}, {"opacity": 1.1}, {"seed": -1}])
def test_parameters_outside_their_range_are_refused(values: dict[str, object]) -> None:
    with pytest.raises(ParameterError, match=next(iter(values))):
        parse_parameters(HairBall.Parameters, values, owner="scene 'hair-ball'")
