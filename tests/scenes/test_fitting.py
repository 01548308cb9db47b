"""The fitted ground, lights and cameras, checked through the camera's frame, which is computed elsewhere."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from shadowbench.light_space import axes_of, camera_frame, is_in_field_of_view
from shadowbench.scene import DirectionalLight, Mesh, PointLight, Scene, SpotLight
from shadowbench.scenes.fitting import FitParameters, direction_of, fitted_camera, fitted_scene
from shadowbench.world import place

CLOUDS = st.lists(
    st.tuples(*[st.floats(-2.0, 2.0, allow_subnormal=False)] * 3), min_size=4, max_size=12, unique=True
).map(np.array)
ANGLES = {"azimuth": st.floats(-180.0, 180.0), "elevation": st.floats(0.0, 90.0)}


def _slab(width: float = 1.0, height: float = 2.0, depth: float = 0.5) -> Mesh:
    """Four corners of a slab, standing on y = 0."""
    corners = [(-width, 0, -depth), (width, 0, depth), (-width, height, depth), (width, height, -depth)]
    return Mesh("slab", np.array(corners, float), np.array([(0, 1, 2), (0, 2, 3), (1, 3, 2), (0, 3, 1)], np.int32))


def _window(scene: Scene, camera: str, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Window coordinates (u, v) of points in a 4:3 picture."""
    world = place(scene)
    return camera_frame(world.cameras[camera], 1024, 768, world).project(points)[:, :2]


@pytest.mark.parametrize(
    ("azimuth", "elevation", "expected"),
    [(0, 0, (0, 0, 1)), (90, 0, (1, 0, 0)), (180, 0, (0, 0, -1)), (-90, 0, (-1, 0, 0)), (33, 90, (0, 1, 0))],
)
def test_azimuth_counts_from_z_to_x_and_elevation_from_the_horizon(
    azimuth: float, elevation: float, expected: tuple[float, float, float]
) -> None:
    assert direction_of(azimuth, elevation) == expected


@given(**ANGLES)
def test_directions_are_unit_vectors(azimuth: float, elevation: float) -> None:
    assert np.linalg.norm(direction_of(azimuth, elevation)) == pytest.approx(1.0, abs=1e-11)


@settings(deadline=None)
@given(points=CLOUDS, **ANGLES)
def test_the_camera_is_the_nearest_that_holds_every_point(
    points: NDArray[np.float64], azimuth: float, elevation: float
) -> None:
    if np.ptp(points, axis=0).max() < 1e-3:
        return
    camera = fitted_camera(points, azimuth, elevation)
    right, down, forward = axes_of(tuple(np.subtract(camera.target, camera.eye)), camera.up)
    offset = points - np.array(camera.eye)
    depth = offset @ forward
    tangent = np.tan(np.radians(camera.vertical_angle) / 2.0)
    x, y = offset @ right / depth / (tangent * 4.0 / 3.0), offset @ down / depth / tangent
    assert depth.min() > 0.0
    assert max(np.abs(x).max(), np.abs(y).max()) <= 0.85 + 1e-6
    # nearest: along one axis both of the picture's margins are touched, or the eye is as near as it may come
    touched = [min(-values.min(), values.max()) for values in (x, y)]
    least = 0.25 * np.linalg.norm(np.ptp(points, axis=0))
    assert max(touched) == pytest.approx(0.85, abs=1e-6) or depth.min() == pytest.approx(least, rel=1e-6)


@pytest.mark.parametrize("angles", [(-65.0, 50.0), (140.0, 12.0), (0.0, 90.0)])
def test_the_overview_holds_the_solid_and_its_shadow(angles: tuple[float, float]) -> None:
    slab = _slab()
    scene = fitted_scene(slab, FitParameters(light_azimuth=angles[0], light_elevation=angles[1]))
    sun = np.array(direction_of(*angles))
    shadow = slab.vertices - sun * (slab.vertices[:, 1:2] / sun[1])
    for camera in ("overview", "top"):
        window = _window(scene, camera, np.concatenate([slab.vertices, shadow]))
        assert window.min() >= 0.074
        assert window.max() <= 0.926


def test_the_close_up_holds_where_the_solid_stands() -> None:
    slab = _slab(height=5.0)  # its first two corners are at the bottom
    world = place(fitted_scene(slab, FitParameters()))
    frame = camera_frame(world.cameras["close-up"], 1024, 768, world)
    assert frame.contains(slab.vertices).tolist() == [True, True, False, False]


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize("elevation", [1.0, 30.0, 90.0])
def test_every_light_is_outside_the_solids_bounding_sphere_and_above_the_ground(scale: float, elevation: float) -> None:
    slab = _slab(scale, 2.0 * scale, 0.5 * scale)
    scene = fitted_scene(slab, FitParameters(light_elevation=elevation))
    assert list(scene.lights) == ["sun", "spot", "lamp"]
    low, high = slab.vertices.min(axis=0), slab.vertices.max(axis=0)
    radius = np.linalg.norm(high - low) / 2.0
    spot, lamp = scene.lights["spot"], scene.lights["lamp"]
    assert isinstance(scene.lights["sun"], DirectionalLight)
    assert isinstance(spot, SpotLight)
    assert isinstance(lamp, PointLight)
    for light in (spot, lamp):
        assert np.linalg.norm(np.array(light.position) - (low + high) / 2.0) > 1.2 * radius
        assert light.position[1] > 0.0


def test_a_solid_that_stands_on_one_point_has_a_close_up_too() -> None:
    corners = np.array([(0.0, 0.0, 0.0), (1.0, 5.0, 0.0), (0.0, 5.0, 1.0)])
    scene = fitted_scene(Mesh("needle", corners, np.array([(0, 1, 2)], np.int32)), FitParameters())
    world = place(scene)
    frame = camera_frame(world.cameras["close-up"], 1024, 768, world)
    assert frame.contains(corners).tolist() == [True, False, False]


def test_the_spot_lights_the_whole_solid() -> None:
    slab = _slab()
    scene = fitted_scene(slab, FitParameters())
    assert is_in_field_of_view(scene.lights["spot"], slab.vertices).all()


def test_the_ground_is_under_the_solid_and_its_shadow() -> None:
    slab = _slab()
    scene = fitted_scene(slab, FitParameters(light_elevation=20.0))
    ground = scene.meshes[1].vertices
    assert (ground[:, 1] == 0.0).all()
    sun = np.array(direction_of(-65.0, 20.0))
    shadow = slab.vertices - sun * (slab.vertices[:, 1:2] / sun[1])
    for axis in (0, 2):
        assert ground[:, axis].min() < shadow[:, axis].min()
        assert ground[:, axis].max() > shadow[:, axis].max()


def test_a_flat_sheet_floats_above_the_ground_instead_of_lying_in_it() -> None:
    scene = fitted_scene(_slab(height=1e-9), FitParameters())
    assert scene.meshes[1].vertices[:, 1].max() < -1e-3


def test_without_a_ground_there_is_the_solid_alone() -> None:
    scene = fitted_scene(_slab(), FitParameters(), with_ground=False)
    assert [m.name for m in scene.meshes] == ["slab"]
    assert len(scene.instances) == 1


def test_a_translation_moves_the_solid_and_all_that_is_fitted_to_it() -> None:
    here = fitted_scene(_slab(), FitParameters(), with_ground=False)
    there = fitted_scene(_slab(), FitParameters(), with_ground=False, translation=(8.0, 16.0, -4.0))
    for name, camera in here.cameras.items():
        np.testing.assert_allclose(np.subtract(there.cameras[name].eye, camera.eye), (8.0, 16.0, -4.0))
    np.testing.assert_allclose(np.subtract(there.lights["lamp"].position, here.lights["lamp"].position), (8, 16, -4))
