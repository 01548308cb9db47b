"""The turntable: one object that keeps its angle, within one circle, under lights and cameras that stay."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scene_geometry import assert_lights_are_usable, digest, lowest, made, shares_seen, smallest_area

from shadowbench.errors import ParameterError
from shadowbench.parameters import parse_parameters
from shadowbench.scene import Mesh
from shadowbench.scenes.turntable import HEIGHT, RADIUS, TREE_TRIANGLES, Turntable
from shadowbench.world import place

OBJECTS = ("tree", "bench", "l-block")


def _model(name: str) -> Mesh:
    return made(Turntable, object=name).meshes[0]


@pytest.mark.parametrize("name", OBJECTS)
def test_the_angle_is_the_instances_rotation_and_nothing_else_changes(name: str) -> None:
    before, after = made(Turntable, object=name), made(Turntable, object=name, angle=37.5)
    assert before.instances[0].rotation.angle == 0.0
    assert after.instances[0].rotation.axis == (0.0, 1.0, 0.0)
    assert after.instances[0].rotation.angle == 37.5
    assert after.instances[1] == before.instances[1]
    assert (after.meshes[0].vertices == before.meshes[0].vertices).all()
    assert (after.lights, after.cameras) == (before.lights, before.cameras)
    assert digest(after) == digest(made(Turntable, object=name, angle=37.5))


def test_a_quarter_turn_takes_x_to_minus_z() -> None:
    """Counter-clockwise seen from above, as the parameter says: x points east, z south."""
    before, after = (place(made(Turntable, object="l-block", angle=angle)) for angle in (0.0, 90.0))
    x, y, z = before.vertices[before.triangles[: before.first_triangle[1]]].reshape(-1, 3).T
    turned = after.vertices[after.triangles[: after.first_triangle[1]]].reshape(-1, 3)
    np.testing.assert_allclose(turned, np.stack([z, y, -x], axis=1), atol=1e-6)


@pytest.mark.parametrize("name", OBJECTS)
def test_objects_stand_on_the_ground_within_one_circle_and_one_height(name: str) -> None:
    x, y, z = _model(name).vertices.astype(np.float64).T
    assert 0.8 * RADIUS < np.hypot(x, z).max() <= RADIUS
    assert 0.6 * HEIGHT < y.max() <= HEIGHT + 1e-6
    world = place(made(Turntable, object=name, angle=10.0))
    assert -0.05 < lowest(world)[name][0] <= 0.0
    assert lowest(world)["ground"] == [0.0]
    assert smallest_area(world) > 1e-8
    assert [i.casts for i in world.instances] == [True, False]
    assert all(i.receives for i in world.instances)


def test_the_tree_has_the_papers_number_of_triangles() -> None:
    assert _model("tree").triangle_count == TREE_TRIANGLES == 36_000


def _outline(mesh: Mesh) -> NDArray[np.float64]:
    """How far the middle of the triangles' areas reaches along directions round the vertical, 64 of them."""
    corners = mesh.vertices[mesh.triangles].astype(np.float64)
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    middle = corners.mean(axis=1)
    middle -= np.average(middle, axis=0, weights=area)
    turn = np.arange(64) * np.pi / 64.0
    along = np.cos(turn)[:, None] * middle[:, 0] + np.sin(turn)[:, None] * middle[:, 2]
    return np.sqrt((area * along**2).sum(axis=1) / area.sum())


def test_the_tree_is_round_about_the_vertical_and_the_other_objects_are_not() -> None:
    flatness = {name: np.ptp(_outline(_model(name))) / _outline(_model(name)).max() for name in OBJECTS}
    assert flatness["tree"] < 0.2
    assert flatness["bench"] > 0.4
    assert flatness["l-block"] > 0.3


@pytest.mark.parametrize("angle", [0.0, 22.5, 135.0])
@pytest.mark.parametrize("name", OBJECTS)
def test_lights_and_cameras_suit_every_object_and_angle(name: str, angle: float) -> None:
    world = place(made(Turntable, object=name, angle=angle))
    assert_lights_are_usable(world)
    assert list(world.cameras) == ["overview", "close"]
    for camera in world.cameras:
        share, lit, shadowed = shares_seen(world, camera)
        assert share > 0.5
        assert lit > 0.6
        assert shadowed > 0.04


@pytest.mark.parametrize("values", [{"object": "cow"}, {"angle": 361.0}, {"angle": float("nan")}])
def test_parameters_outside_their_range_are_refused(values: dict[str, object]) -> None:
    with pytest.raises(ParameterError, match=next(iter(values))):
        parse_parameters(Turntable.Parameters, values, owner="scene 'turntable'")
