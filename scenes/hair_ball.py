"""The hair ball of Aila and Laine's Figure 1: thousands of thin curly hairs that let most of the light through.

5000 hairs of 96 segments, each a three-sided tube of 6 triangles a segment, make 5000 x 576 = 2,880,000 triangles with
an opacity of 10 %, over a ground. A hair is a helix whose axis is turned back wherever it is about to leave the ball.
Its frame is carried along by exact rotations (Cayley's form, which needs no sine), so every machine builds the same
bits. Fewer ``segments`` make the same hairs coarser; fewer ``hairs`` make the same ball thinner.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel

from shadowbench.parameters import ParameterModel, parameter
from shadowbench.scene import (
    Camera,
    DirectionalLight,
    Instance,
    Light,
    Mesh,
    PointLight,
    Scene,
    ScenePlugin,
    SpotLight,
    Vector,
)

from .tubes import tube_triangles
from .uniform_draws import Array, Axis, UniformDraws, rotated_axes

SIDES = 3
"""Sides of a hair's tube; so a hair has 2 x SIDES triangles a segment."""

HAIR_LENGTH = 4.0
"""Along the hair [scene units]; the ball's radius is about 1."""

CURVATURE, TORSION = (2.5, 6.0), (1.5, 4.5)
"""Least and largest of a hair's curvature and torsion [1 / scene units]: helices of radius 0.09 to 0.3."""

CORE_RADIUS, FREE_RADIUS, TURNING = 0.25, 0.6, 6.0
"""Hairs begin on a sphere of the first radius; beyond the second they are turned back, the farther out the more, by up
to so much [1 / scene units] at radius 1."""

CENTRE: Vector = (0.0, 1.35, 0.0)
"""High enough that no hair reaches the ground; the farthest come 1.24 from here, with the fewest segments 1.33."""

TINTS: tuple[tuple[Vector, Vector], ...] = (
    ((0.05, 0.00, -0.05), (0.90, 0.62, 0.28)),
    ((0.00, 0.04, -0.04), (0.80, 0.72, 0.36)),
    ((0.05, -0.02, -0.03), (0.86, 0.40, 0.26)),
    ((-0.05, 0.00, 0.05), (0.42, 0.52, 0.74)),
    ((0.02, -0.05, 0.03), (0.76, 0.42, 0.58)),
)
"""Groups of hairs: what is added to the transmittance of red, green and blue (0 on average), and the albedo."""

LIGHTS: dict[str, Light] = {
    "sun": DirectionalLight((0.45, 1.0, 0.35)),
    "spot": SpotLight(position=(2.4, 4.6, 1.6), direction=(-2.4, -3.6, -1.6), angle=50.0),
    "lamp": PointLight((1.2, 2.3, 1.2)),
}
"""The lamp hangs close to the ball, within the bounds of the scene."""

CAMERAS = {
    "figure": Camera(eye=(-0.15, 2.75, 5.6), target=(-0.15, 1.08, 0.0), vertical_angle=30.0),
    "close": Camera(eye=(0.9, 2.45, 2.6), target=(0.3, 1.6, 0.4), vertical_angle=24.0),
}


class HairBall(ScenePlugin):
    """See the module."""

    name = "hair-ball"
    title = "Hair ball"
    source = "Aila and Laine 2004, Figure 1"

    class Parameters(ParameterModel):
        """The scene's size, look and seed."""

        hairs: int = parameter(5000, unit="hairs", help="How many hairs the ball has.", ge=1, le=10_000)
        segments: int = parameter(
            96, unit="segments", help="Straight pieces of a hair, of 6 triangles each.", ge=24, le=200
        )
        opacity: float = parameter(
            0.1, unit="1", help="Share of the light that a surface keeps; 1 for opaque hair.", gt=0.0, le=1.0
        )
        thickness: float = parameter(
            0.004, unit="scene units", help="Diameter of a hair where it is thickest.", gt=0.0, le=0.1
        )
        seed: int = parameter(1, unit="1", help="Another seed is another draw of the same kind.", ge=0, lt=2**32)

    def make(self, parameters: BaseModel) -> Scene:
        """Grow the hairs, dye them group by group, and lay the ground."""
        assert isinstance(parameters, self.Parameters)
        vertices = hair_tubes(parameters.hairs, parameters.segments, parameters.thickness / 2.0, parameters.seed)
        group_count = min(len(TINTS), parameters.hairs)
        meshes, instances = [], []
        for group in range(group_count):
            strands = vertices[group::group_count]
            triangles = tube_triangles(strands.shape[0], strands.shape[1], SIDES)
            meshes.append(Mesh(f"hairs {group + 1}", strands.reshape(-1, 3), triangles))
            tint, albedo = TINTS[group]
            instances.append(Instance(group, transmittance=_tinted(1.0 - parameters.opacity, tint), albedo=albedo))
        corners = [(-6.0, 0.0, -6.0), (6.0, 0.0, -6.0), (6.0, 0.0, 6.0), (-6.0, 0.0, 6.0)]
        meshes.append(Mesh("ground", np.array(corners), np.array([(0, 2, 1), (0, 3, 2)], np.int32)))
        instances.append(Instance(group_count, albedo=(0.80, 0.79, 0.76)))
        return Scene(tuple(meshes), tuple(instances), LIGHTS, CAMERAS)


def _tinted(transmittance: float, tint: Vector) -> Vector:
    """Return a coloured transmittance of the given mean; the tint fades where there is no room for it."""
    room = min(1.0, 10.0 * transmittance, 10.0 * (1.0 - transmittance))
    red, green, blue = (min(1.0, max(0.0, transmittance + room * t)) for t in tint)
    return (red, green, blue)


def hair_tubes(hair_count: int, segment_count: int, radius: float, seed: int) -> NDArray[np.float32]:
    """Return the vertices of the hairs' tubes, float32, shape [hair_count, segment_count + 1, SIDES, 3].

    Rings of SIDES vertices follow each other from the root, where a hair is thickest, to a tip a quarter as thick.
    """
    draw = UniformDraws(seed)
    # a moving frame: along the hair, towards the helix's axis, and across both
    along, inward, across = rotated_axes(draw.unit_quaternions(hair_count))
    curvature, torsion = (low + (high - low) * draw.unit_interval(hair_count) for low, high in (CURVATURE, TORSION))
    handedness = np.where(draw.unit_interval(hair_count) < 0.5, -1.0, 1.0)
    place = _times(CORE_RADIUS, along)

    step = HAIR_LENGTH / segment_count
    half_root = math.sqrt(3.0) / 2.0
    vertices = np.empty((hair_count, segment_count + 1, SIDES, 3), np.float32)
    for ring in range(segment_count + 1):
        tapered = radius * (1.0 - 0.75 * ring / segment_count)
        for side, (cosine, sine) in enumerate(((1.0, 0.0), (-0.5, half_root), (-0.5, -half_root))):
            for axis in range(3):
                offset = cosine * inward[axis] + sine * across[axis]
                vertices[:, ring, side, axis] = CENTRE[axis] + place[axis] + tapered * offset
        # Frenet: the frame turns by torsion along the hair and by curvature across it, which winds a helix
        heading = _plus(_times(torsion, along), _times(handedness * curvature, across))
        turn = _plus(_times(handedness, heading), _turned_back(place, heading))
        half_turn = _times(0.5 * step, turn)
        before = along
        along, inward, across = (_rotated(axis, half_turn) for axis in (along, inward, across))
        place = _plus(place, _times(0.5 * step, _plus(before, along)))
    return vertices


def _turned_back(place: Axis, heading: Axis) -> Axis:
    """Return the rotation that bends a helix's axis, along which it is ``heading``, back to the ball's centre."""
    distance = np.sqrt(_dot(place, place))
    outside = np.clip((distance - FREE_RADIUS) / (1.0 - FREE_RADIUS), 0.0, None)
    factor = TURNING * outside / (distance * np.sqrt(_dot(heading, heading)))
    return _times(factor, _cross(place, heading))


def _rotated(vector: Axis, half_turn: Axis) -> Axis:
    """Rotate by Cayley's form: v + 2 / (1 + g²) (g x v + g x (g x v)), g = tan(angle / 2) times the axis."""
    factor = 2.0 / (1.0 + _dot(half_turn, half_turn))
    once = _cross(half_turn, vector)
    twice = _cross(half_turn, once)
    return _plus(vector, _times(factor, _plus(once, twice)))


def _plus(a: Axis, b: Axis) -> Axis:
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


def _times(factor: float | Array, a: Axis) -> Axis:
    return (factor * a[0], factor * a[1], factor * a[2])


def _dot(a: Axis, b: Axis) -> Array:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _cross(a: Axis, b: Axis) -> Axis:
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])
