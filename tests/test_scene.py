"""The scene model: what it accepts, what it refuses in one line, and rotations without rounding at quarter turns."""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from builders import SUN, square
from hypothesis import given
from hypothesis import strategies as st

from shadowbench.errors import SceneError
from shadowbench.scene import (
    Camera,
    DirectionalLight,
    Instance,
    Mesh,
    PointLight,
    RectangularLight,
    Rotation,
    Scene,
    SpotLight,
    Vector,
    cosine_sine,
)

CAMERA = Camera((0.0, 1.0, 5.0), (0.0, 0.0, 0.0))
CORNERS = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0)], np.float32)
ONE = np.array([(0, 1, 2)], np.int32)


@pytest.mark.parametrize(
    ("vertices", "triangles", "words"),
    [
        (CORNERS, np.zeros((0, 3), np.int32), "no triangles"),
        (CORNERS, np.array([(0, 1, 3)]), r"names vertex 3, but there are 3 vertices \(0 to 2\)"),
        (CORNERS, np.array([(0, -1, 2)]), "names vertex -1"),
        (CORNERS, np.array([(0.0, 1.0, 2.0)]), "triangles must be integers"),
        (CORNERS, np.array([0, 1, 2]), r"of shape \[n, 3\]"),
        (CORNERS[:, :2], ONE, "vertices must be float32 or float64"),
        (CORNERS.astype(np.int64), ONE, "vertices must be float32 or float64"),
        (np.where(CORNERS == 1, np.nan, CORNERS).astype(np.float32), ONE, "vertex 1 is not finite"),
        (np.where(CORNERS == 1, np.inf, CORNERS).astype(np.float32), ONE, "vertex 1 is not finite"),
    ],
)
def test_a_mesh_that_cannot_be_drawn_is_refused_by_name(vertices: Any, triangles: Any, words: str) -> None:
    with pytest.raises(SceneError, match=f"mesh 'solid'.*{words}"):
        Mesh("solid", vertices, triangles)


def test_a_mesh_keeps_precision_and_takes_any_integers() -> None:
    mesh = Mesh("solid", CORNERS.astype(np.float64)[::1], ONE.astype(np.uint64))
    assert mesh.vertices.dtype == np.float64
    assert mesh.triangles.dtype == np.int32
    assert mesh.triangle_count == 1


def test_a_view_into_other_memory_becomes_contiguous() -> None:
    wide = np.zeros((3, 4), np.float32)
    wide[:, :3] = CORNERS
    assert Mesh("solid", wide[:, :3], ONE).vertices.flags.c_contiguous


@pytest.mark.parametrize("turns", range(-5, 6))
@pytest.mark.parametrize("axis", [(0.0, 0.0, 2.0), (0.0, 3.0, 0.0), (0.5, 0.0, 0.0)])
def test_quarter_turns_are_exact(axis: Vector, turns: int) -> None:
    matrix = Rotation(axis, 90.0 * turns).matrix()
    assert set(np.abs(matrix).reshape(-1).tolist()) == {0.0, 1.0}
    # about z, a quarter turn takes x to y (right-hand rule); the other axes follow cyclically
    k = int(np.argmax(axis))
    x, y = (k + 1) % 3, (k + 2) % 3
    quarter = [(1, 0), (0, 1), (-1, 0), (0, -1)][turns % 4]
    assert (matrix[x, x], matrix[y, x]) == quarter


@given(
    axis=st.tuples(*[st.floats(-10.0, 10.0)] * 3).filter(lambda a: sum(c * c for c in a) > 1e-3),
    angle=st.floats(-720.0, 720.0),
)
def test_rotations_turn_by_their_angle_about_their_axis(axis: Vector, angle: float) -> None:
    matrix = Rotation(axis, angle).matrix()
    np.testing.assert_allclose(matrix @ matrix.T, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(matrix @ axis, axis, atol=1e-11)
    assert np.linalg.det(matrix) == pytest.approx(1.0)
    assert np.trace(matrix) == pytest.approx(1.0 + 2.0 * math.cos(math.radians(angle)), abs=1e-11)


def test_cosines_and_sines_are_within_a_bit_of_the_truth() -> None:
    """The truth: the library's, of the angle reduced to an eighth of a turn in fractions."""
    degrees = [
        -1234.5,
        -90.000001,
        -45.0,
        -1e-9,
        0.0,
        1e-300,
        12.5,
        44.999999,
        45.0,
        45.000001,
        89.75,
        135.0,
        359.0,
        1e6,
    ]
    cosines, sines = cosine_sine(np.array(degrees))
    for angle, cosine, sine in zip(degrees, cosines, sines, strict=True):
        turn = Fraction(angle) % 360
        eighths = round(turn / 90)
        rest = math.radians(float(turn - 90 * eighths))
        c, s = math.cos(rest), math.sin(rest)
        expected = [(c, s), (-s, c), (-c, -s), (s, -c)][eighths % 4]
        assert (cosine, sine) == pytest.approx(expected, rel=2.0**-51, abs=2.0**-52)


def test_an_array_of_angles_gives_the_same_bits_as_one_at_a_time() -> None:
    degrees = np.linspace(-400.0, 400.0, 1003)
    together = np.stack(cosine_sine(degrees))
    assert (together == np.array([cosine_sine(float(d)) for d in degrees]).T).all()


def test_an_instance_scales_then_rotates_then_translates() -> None:
    instance = Instance(0, translation=(10, 20, 30), scale=(2, 3, 4), rotation=Rotation((0, 0, 1), 90.0))
    matrix = instance.matrix()
    # (1, 1, 1) -> (2, 3, 4) -> (-3, 2, 4) -> (7, 22, 34)
    assert (matrix @ [1, 1, 1, 1]).tolist() == [7.0, 22.0, 34.0]
    assert not instance.is_placed_as_modelled
    assert Instance(0).is_placed_as_modelled


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Instance(0, scale=(1.0, 0.0, 1.0)), "scale"),
        (lambda: Instance(0, scale=(1.0, math.nan, 1.0)), "scale"),
        (lambda: Instance(0, transmittance=(0.0, 1.5, 0.0)), "transmittance"),
        (lambda: Rotation((0.0, 0.0, 0.0), 10.0).matrix(), "axis"),
        (lambda: DirectionalLight((0.0, 0.0, 0.0)), "direction"),
        (lambda: DirectionalLight((0.0, math.inf, 0.0)), "direction"),
        (lambda: SpotLight((0, 0, 0), (0, 0, 0)), "direction"),
        (lambda: SpotLight((0, 0, 0), (0, -1, 0), angle=180.0), "angle"),
        (lambda: SpotLight((0, 0, 0), (0, -1, 0), angle=0.0), "angle"),
        (lambda: SpotLight((0, 0, 0), (0, -1, 0), near=0.0), "near"),
        (lambda: PointLight((0, 0, 0), near=-1.0), "near"),
        (lambda: RectangularLight((0, 0, 0), (1, 0, 0), (2, 0, 0)), "area"),
        (lambda: Camera((1, 2, 3), (1, 2, 3)), "view"),
        (lambda: Camera((0, 5, 0), (0, 0, 0)), "parallel"),
        (lambda: Camera((math.nan, 5, 0), (0, 0, 0)), "view"),
        (lambda: Camera((0, 0, 5), (0, 0, 0), vertical_angle=171.0), "vertical angle"),
    ],
)
def test_lights_cameras_and_instances_without_a_meaning_are_refused(make: Any, words: str) -> None:
    with pytest.raises(SceneError, match=words) as caught:
        make()
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"instances": ()}, "no instance"),
        ({"lights": {}}, "no light"),
        ({"cameras": {}}, "no camera"),
        ({"instances": (Instance(1),)}, "names mesh 1, but there are 1"),
        ({"instances": (Instance(-1),)}, "names mesh -1"),
    ],
)
def test_a_scene_needs_something_of_everything(changes: dict[str, Any], words: str) -> None:
    whole = {"meshes": (Mesh("ground", *square(1.0)),), "instances": (Instance(0),)}
    whole |= {"lights": {"sun": SUN}, "cameras": {"front": CAMERA}}
    assert Scene(**whole).triangle_count == 2
    with pytest.raises(SceneError, match=words):
        Scene(**(whole | changes))


def test_triangles_are_counted_over_instances() -> None:
    mesh = Mesh("ground", *square(1.0))
    scene = Scene((mesh,), (Instance(0), Instance(0), Instance(0)), {"sun": SUN}, {"front": CAMERA})
    assert scene.triangle_count == 6
