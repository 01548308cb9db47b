"""What moves between two frames: the frame before, and what is told of the step."""

from dataclasses import replace

import numpy as np
import pytest

from shadowbench.choices import MOVING
from shadowbench.contract import trial_world
from shadowbench.motion import CAMERA_TURN, LIGHT_TURN, STEP, TURN, Moment, moment_before
from shadowbench.scene import DirectionalLight

WORLD = trial_world()


def moment(light: str = "directional") -> Moment:
    return Moment(WORLD, WORLD.lights[light], WORLD.cameras["front"])


def angle_between(a: tuple[float, ...], b: tuple[float, ...]) -> float:
    cosine = np.dot(a, b) / np.linalg.norm(a) / np.linalg.norm(b)
    return float(np.degrees(np.arccos(cosine)))


@pytest.mark.parametrize("moving", MOVING)
def test_only_what_moves_is_elsewhere_in_the_frame_before(moving: str) -> None:
    now = moment()
    before, changes = moment_before(now, moving)
    assert (before.light != now.light) == (moving == "light")
    assert (before.camera != now.camera) == (moving == "camera")
    assert (before.world is not now.world) == (moving == "object")
    assert changes.light == (moving in ("light", "everything"))
    assert changes.view == (moving in ("camera", "everything"))
    assert changes.instances == {"everything": {0, 1}, "object": {0}}.get(moving, set())


def test_an_object_takes_a_step_and_turns_and_everything_else_stays() -> None:
    before, _ = moment_before(moment(), "object")
    box, stood = before.world.instances[0], WORLD.instances[0]
    assert np.linalg.norm(np.subtract(box.translation, stood.translation)) == pytest.approx(STEP * WORLD.diagonal())
    assert box.rotation.angle - stood.rotation.angle == TURN
    assert box.version != stood.version
    assert before.world.instances[1] == WORLD.instances[1]
    corners, stood_at = before.world.vertices[:8].astype(np.float64), WORLD.vertices[:8]
    assert np.array_equal(before.world.vertices[8:], WORLD.vertices[8:])
    matrix = box.matrix()
    assert np.allclose(corners, stood_at @ matrix[:, :3].T + matrix[:, 3], atol=1e-6)


def test_parallel_light_turns_by_a_degree() -> None:
    before, _ = moment_before(moment(), "light")
    light, stood = before.light, WORLD.lights["directional"]
    assert isinstance(light, DirectionalLight)
    assert isinstance(stood, DirectionalLight)
    level = [(direction[0], direction[2]) for direction in (light.direction, stood.direction)]
    assert angle_between(*level) == pytest.approx(LIGHT_TURN, abs=1e-6)


def test_vertical_light_turns_too() -> None:
    vertical = DirectionalLight((0.0, 1.0, 0.0))
    before, _ = moment_before(replace(moment(), light=vertical), "light")
    assert isinstance(before.light, DirectionalLight)
    assert angle_between(before.light.direction, vertical.direction) == pytest.approx(LIGHT_TURN, abs=1e-6)


@pytest.mark.parametrize("name", ["spot", "point", "area"])
def test_light_from_a_place_takes_a_step(name: str) -> None:
    before, _ = moment_before(moment(name), "light")
    field = "corner" if name == "area" else "position"
    step = np.subtract(getattr(before.light, field), getattr(WORLD.lights[name], field))
    assert np.linalg.norm(step) == pytest.approx(STEP * WORLD.diagonal())


def test_the_camera_goes_round_its_target() -> None:
    camera, stood = moment_before(moment(), "camera")[0].camera, WORLD.cameras["front"]
    away, stood_away = np.subtract(camera.eye, camera.target), np.subtract(stood.eye, stood.target)
    assert camera.target == stood.target
    assert np.linalg.norm(away) == pytest.approx(np.linalg.norm(stood_away))
    assert angle_between(tuple(away), tuple(stood_away)) == pytest.approx(CAMERA_TURN, abs=1e-6)


def test_what_does_not_exist_cannot_move() -> None:
    with pytest.raises(ValueError, match="nothing moves like 'moon'"):
        moment_before(moment(), "moon")


def test_where_nothing_casts_no_object_moves() -> None:
    world = replace(WORLD, instances=tuple(replace(i, casts=False) for i in WORLD.instances))
    before, changes = moment_before(replace(moment(), world=world), "object")
    assert before.world is world
    assert not changes.instances
