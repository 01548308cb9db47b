"""A garden shut in by fences, after Annen et al.'s scene of 365 K faces: 365,000 triangles, exactly.

A brick wall behind, a wire fence in front of it with creepers and sunflowers between, picket fences on the other three
sides with an open gate, and uncut grass along all of them. Almost all that casts is thinner than a texel of a common
shadow map and lies close before what it shades: wires over bricks, blades of grass over ground, pickets over grass. All
that is not green takes the same triangles whatever ``triangles`` says; leaves and grass take the rest, exactly.
"""

from __future__ import annotations

import math

import numpy as np
from pydantic import BaseModel

from shadowbench.parameters import ParameterModel, parameter
from shadowbench.scene import Camera, DirectionalLight, Light, PointLight, Scene, ScenePlugin, SpotLight, Vector

from . import furniture
from .masonry import BRICKS, STONES, brick_facing, paving
from .plants import (
    LEAF_TRIANGLES,
    Bush,
    along,
    bush_stems,
    bushes,
    leaf_length,
    leaves_about,
    tufts,
    within,
)
from .setting import Place, Setting
from .shapes import Shape, boxes, joined, rectangle, revolved
from .sunflowers import Sunflowers
from .tubes import tubes
from .uniform_draws import UniformDraws

WALL_Z, WIRE_Z = -3.6, -2.75
"""The faces of the wall's mortar and of the wire fence."""

FRONT_Z, SIDE_X = 4.0, 6.0
"""Where the picket fences stand."""

WALL_HEIGHT, WIRE_HEIGHT = 2.0, 1.6

LIGHTS: dict[str, Light] = {
    "sun": DirectionalLight((-0.55, 0.68, 0.62)),
    "spot": SpotLight(position=(-6.0, 9.0, 9.0), direction=(6.0, -9.0, -10.0), angle=70.0),
    "lamp": PointLight((0.7, 1.9, -0.4)),
}

CAMERAS = {
    "overview": Camera(eye=(4.6, 4.3, 8.3), target=(-0.45, 0.1, -0.55), vertical_angle=40.0),
    "wires": Camera(eye=(1.2, 1.5, 0.2), target=(-0.4, 0.8, -3.4), vertical_angle=36.0),
    "contact": Camera(eye=(3.9, 0.85, 3.0), target=(5.9, 0.35, 1.9), vertical_angle=36.0),
    "grazing": Camera(eye=(5.5, 0.6, 3.2), target=(-3.0, 0.0, 2.9), vertical_angle=36.0),
}

GREENS: tuple[Vector, ...] = ((0.27, 0.45, 0.14), (0.36, 0.52, 0.18), (0.44, 0.55, 0.22), (0.22, 0.40, 0.16))
EARTH_ALBEDO: Vector = (0.44, 0.42, 0.25)
PICKET_ALBEDO: Vector = (0.80, 0.74, 0.62)
BARK_ALBEDO: Vector = (0.36, 0.27, 0.20)

LEAST_TRIANGLES = 100_000
"""Twice all that is not green."""


class Fence(ScenePlugin):
    """See the module."""

    name = "fence"
    title = "Garden behind fences"
    source = "after Annen et al. 2008, Figure 8"

    class Parameters(ParameterModel):
        """The scene's size and seed."""

        triangles: int = parameter(
            365_000,
            unit="triangles",
            help="Of the whole scene; more of them make more and finer grass and leaves.",
            ge=LEAST_TRIANGLES,
            le=4_000_000,
        )
        seed: int = parameter(
            1, unit="1", help="Another seed grows other plants and lays other bricks.", ge=0, lt=2**32
        )

    def make(self, parameters: BaseModel) -> Scene:
        """Build walls and fences, then let the grass grow."""
        assert isinstance(parameters, self.Parameters)
        draw = UniformDraws(parameters.seed)
        setting = Setting()
        setting.add("ground", rectangle((-7.2, 7.2), (-4.4, 5.8)), EARTH_ALBEDO)
        _build_wall(setting, draw)
        _stretch_wires(setting)
        _fence_in(setting)
        _furnish(setting, draw)
        _plant(setting, draw, parameters.triangles)
        return setting.scene(LIGHTS, CAMERAS)


def _build_wall(setting: Setting, draw: UniformDraws) -> None:
    """Build a wall of bricks that stand out from their mortar, under a coping of slabs."""
    back = WALL_Z - 0.24
    setting.add("mortar", boxes((-SIDE_X, 0.0, back), (SIDE_X, WALL_HEIGHT, WALL_Z)), (0.70, 0.67, 0.62))
    for k, bricks in enumerate(brick_facing(draw, 2.0 * SIDE_X, WALL_HEIGHT, (0.26, 0.08), 0.012, 0.012)):
        setting.add(f"bricks {k + 1}", bricks, BRICKS[k], (-SIDE_X, 0.0, WALL_Z, 0.0))
    left = -SIDE_X - 0.05 + 0.605 * np.arange(20)[:, None]
    low = np.concatenate([left, np.full((20, 1), WALL_HEIGHT), np.full((20, 1), back - 0.06)], axis=1)
    setting.add("coping", boxes(low, low + np.array([0.595, 0.07, 0.38])), STONES[1])


def _stretch_wires(setting: Setting) -> None:
    """Stretch a mesh of zigzag wires, each hooked into its neighbours, between steel posts."""
    pitch, thickness = 0.08, 0.004
    count, rows = round(2.0 * SIDE_X / pitch) - 1, round((WIRE_HEIGHT - 0.04) / pitch)
    wire, row = np.arange(count)[:, None], np.arange(rows + 1)
    right = (wire + row) % 2
    x = -SIDE_X + pitch * (wire + right) + 0.5 * pitch
    y = np.broadcast_to(0.04 + pitch * row, x.shape)
    # the bends to the right pass in front of the next wire's bends to the left
    mesh = tubes(np.stack([x, y, WIRE_Z + thickness * (2.0 * right - 1.0)], axis=2), thickness, 4)
    lines = [[(-SIDE_X, level, WIRE_Z), (SIDE_X, level, WIRE_Z)] for level in (0.05, 0.82, WIRE_HEIGHT)]
    setting.add("wires", joined([mesh, tubes(lines, 0.006, 5)]), (0.42, 0.47, 0.44))
    post = joined([tubes([[(0.0, 0.0, 0.0), (0.0, 1.68, 0.0)]], 0.03, 12), _cap(0.036, 1.68)])
    places: list[Place] = [(x, 0.0, WIRE_Z - 0.04, 0.0) for x in np.linspace(-5.9, 5.9, 7).tolist()]
    setting.add("wire post", post, (0.35, 0.38, 0.36), *places)


def _cap(radius: float, level: float) -> Shape:
    return revolved([(0.0, level - 0.02), (radius, level - 0.02), (radius, level), (0.0, level + 0.02)], 12)


def _fence_in(setting: Setting) -> None:
    """Fence in the sides and the front, which leaves a way in with a gate that stands open."""
    panel = furniture.picket_fence(1.5, 1.1, 0.125)
    # a panel runs along its x with its pickets on +z: they face away from the garden
    left: list[Place] = [(-SIDE_X, 0.0, -3.5 + 1.5 * k, -90.0) for k in range(5)]
    right: list[Place] = [(SIDE_X, 0.0, -2.0 + 1.5 * k, 90.0) for k in range(5)]
    front: list[Place] = [(x, 0.0, FRONT_Z, 0.0) for x in (-6.0, -4.5, -3.0, 1.5, 3.0, 4.5)]
    setting.add("fence", panel, PICKET_ALBEDO, *left, *right, *front)
    setting.add("gate", furniture.picket_fence(1.4, 1.2, 0.117), (0.70, 0.62, 0.48), (-1.4, 0.0, FRONT_Z - 0.05, 62.0))
    setting.add(
        "gate post", boxes((-0.06, 0.0, -0.06), (0.06, 1.35, 0.06)), PICKET_ALBEDO, (1.44, 0.0, FRONT_Z - 0.08, 0.0)
    )


def _furnish(setting: Setting, draw: UniformDraws) -> None:
    """Pave a path from the gate, and set a bench, pots and a crate beside it."""
    for k, stones in enumerate(paving(draw, (-0.75, 0.75), (-1.2, 3.9), (0.5, 0.46), 0.03, 0.035)):
        setting.add(f"paving {k + 1}", stones, STONES[k])
    setting.add("bench", furniture.seat(1.5, arms=True), (0.56, 0.40, 0.26), (2.6, 0.0, -1.05, -14.0))
    setting.add("crate", furniture.crate(0.5, 0.34, 0.4), (0.62, 0.46, 0.30), (-2.3, 0.0, 0.3, 24.0))
    setting.add("watering can", furniture.watering_can(), (0.45, 0.55, 0.60), (-1.35, 0.0, 1.1, 150.0))
    pots: list[Place] = [(pot.x, 0.0, pot.z, 0.0) for pot in POT_PLANTS]
    setting.add("pot", furniture.pot(0.19, 0.33), ((0.72, 0.40, 0.27), (0.55, 0.56, 0.55)), *pots)
    ladder = furniture.ladder(1.9, 0.55)
    setting.add("ladder", ladder, (0.60, 0.45, 0.30), (4.2, 0.0, WALL_Z + 0.05, 0.0))


POT_PLANTS = (Bush(1.15, 0.25, 3.3, 0.24, 0.5), Bush(-1.95, 0.25, 3.2, 0.22, 0.55), Bush(1.3, 0.25, -0.9, 0.26, 0.6))

BUSHES = (
    Bush(-5.1, 0.0, -1.2, 0.6, 1.1),
    Bush(5.1, 0.0, -0.4, 0.6, 1.0),
    Bush(-5.0, 0.0, 1.0, 0.45, 0.7),
    Bush(-3.9, 0.0, -1.7, 0.5, 0.8),
)

GRASS_EDGES = (
    *[(x, -3.4, x, 3.9) for x in (-5.9, 5.9)],
    *[(x0, FRONT_Z - 0.12, x1, FRONT_Z - 0.12) for x0, x1 in ((-5.9, -1.5), (1.5, 5.9))],
    *[(-5.9, z, 5.9, z) for z in (WIRE_Z, WIRE_Z + 0.15, WALL_Z + 0.2)],
)
"""Where the grass is tallest: at the fences, under the wires, and along the wall."""


def _plant(setting: Setting, draw: UniformDraws, triangles: int) -> None:
    """Plant flowers, bushes and creepers, and sow grass, which use up the triangles that are left."""
    flowers = Sunflowers(draw, 16, (-5.4, 5.4), (WALL_Z + 0.35, WIRE_Z - 0.3))
    setting.add("sunflower stems", flowers.stems(), GREENS[3])
    setting.add("sunflower petals", flowers.petals(), (0.90, 0.68, 0.10))
    setting.add("sunflower hearts", flowers.hearts(), (0.33, 0.22, 0.12))
    setting.add("stems", bush_stems(draw, POT_PLANTS + BUSHES), BARK_ALBEDO)
    left = triangles - setting.triangle_count
    setting.add("sunflower leaves", flowers.leaves(draw, int(0.01 * left), 3.0), GREENS[1])
    setting.add("potted plants", bushes(draw, int(0.03 * left), POT_PLANTS, 2.6), GREENS[0])
    setting.add("bushes", bushes(draw, int(0.12 * left), BUSHES, 9.0), GREENS[3])
    setting.add("creepers", _creepers(draw, int(0.14 * left)), GREENS[0])
    tall = int(0.4 * left)
    edges = along(draw, max(8, tall // 60), GRASS_EDGES)
    finer = math.sqrt(120_000.0 / tall)
    setting.add("tall grass", tufts(draw, tall, edges, 0.13, 0.42, 0.009 * finer), GREENS[2])
    lawn_triangles = triangles - setting.triangle_count
    count = max(8, lawn_triangles // 40)
    lawn = np.stack([within(draw, count, -4.6, 5.8), within(draw, count, WIRE_Z + 0.4, 2.5)], axis=1)
    # none comes up through the path
    lawn[:, 0] = np.where(np.abs(lawn[:, 0]) < 0.95, lawn[:, 0] + np.where(lawn[:, 0] < 0.0, -2.2, 2.2), lawn[:, 0])
    setting.add("lawn", tufts(draw, lawn_triangles, lawn, 0.12, 0.1, 0.008 * finer), GREENS[1])


def _creepers(draw: UniformDraws, triangle_count: int) -> Shape:
    """Return leaves that have climbed the wire fence in four places, densest at their feet."""
    count = -(-triangle_count // LEAF_TRIANGLES)
    foot = np.array([-4.6, -2.9, 1.9, 4.9])[np.arange(count) % 4]
    height = draw.unit_interval(count) * np.maximum(draw.unit_interval(count), 0.6)
    sideways = 2.0 * draw.unit_interval(count) - 1.0
    x = foot + 0.75 * sideways * np.sqrt(1.0 - 0.7 * height)
    side = np.where(draw.unit_interval(count) < 0.6, 1.0, -1.0)
    base = np.stack([x, 0.08 + 1.5 * height, WIRE_Z + side * within(draw, count, 0.01, 0.09)], axis=1)
    outward = np.stack([0.4 * sideways, np.zeros(count), side], axis=1)
    return leaves_about(draw, base, outward, leaf_length(count, 10.0)).first(triangle_count)
