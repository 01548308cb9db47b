"""A backyard in summer, after the one that Annen et al. measure on: 150,000 triangles, which is not their count.

A house with a tiled roof, a patio under a pergola with a vine, a table laid for four, pots, crates and tools that stand
on the ground and lean against walls, a lawn with a tree, washing, a parasol, a kennel and a ball, and a picket fence
round it all. It holds what the paper's figures stress: contact shadows everywhere, many layers under the pergola and
the tree, slanted and curved receivers (roof, cloths, ladder), and a lawn that runs far away under a low camera. All
that is not green takes the same triangles whatever ``triangles`` says; leaves and grass take the rest, exactly.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from pydantic import BaseModel

from shadowbench.parameters import ParameterModel, parameter
from shadowbench.scene import Camera, DirectionalLight, Light, PointLight, Scene, ScenePlugin, SpotLight, Vector

from . import furniture
from .house import House
from .masonry import STONES, paving
from .plants import LEAF_TRIANGLES, Bush, along, bush_stems, bushes, leaf_length, leaves_about, tufts, within
from .setting import Place, Setting
from .shapes import Shape, bars, boxes, joined, rectangle, sphere
from .trees import tree
from .tubes import tubes
from .uniform_draws import UniformDraws

HOUSE = House(
    x=(-10.5, -1.0),
    depth=5.5,
    eaves=3.3,
    ridge=5.4,
    windows=((-9.6, -8.5, 0.95, 2.25), (-6.9, -5.7, 0.95, 2.25)),
    door=(-4.4, -3.3, 0.16, 2.35),
)
HOUSE_FRONT = -6.5
"""The z of the house's front wall."""

PATIO_X, PATIO_Z, PATIO_TOP = (-8.2, -1.2), (-6.5, -2.5), 0.045

LIGHTS: dict[str, Light] = {
    "sun": DirectionalLight((-0.62, 1.0, 0.55)),
    "spot": SpotLight(position=(-9.0, 13.0, 11.0), direction=(9.0, -13.0, -13.0), angle=68.0),
    "lamp": PointLight((-0.6, 3.1, -1.2)),
}
"""The lamp hangs over the patio's edge, lower than the eaves and within everything's bounds."""

CAMERAS = {
    "overview": Camera(eye=(9.6, 6.9, 13.8), target=(0.7, 0.55, -3.2), vertical_angle=40.0),
    "contact": Camera(eye=(0.3, 1.75, -2.1), target=(-2.3, 0.35, -5.9), vertical_angle=36.0),
    "layers": Camera(eye=(-3.0, 3.9, 1.0), target=(-5.6, 1.0, -4.6), vertical_angle=38.0),
    "grazing": Camera(eye=(-9.2, 0.7, 10.7), target=(-9.0, 0.2, 4.0), vertical_angle=38.0),
}

GREENS: tuple[Vector, ...] = ((0.27, 0.45, 0.14), (0.34, 0.52, 0.17), (0.22, 0.40, 0.16), (0.42, 0.55, 0.20))
WOODS: tuple[Vector, ...] = ((0.62, 0.46, 0.30), (0.56, 0.40, 0.26))
TERRACOTTA: tuple[Vector, ...] = ((0.72, 0.40, 0.27), (0.64, 0.36, 0.25), (0.55, 0.56, 0.55))
PICKET_ALBEDO: Vector = (0.88, 0.86, 0.80)
BARK_ALBEDO: Vector = (0.36, 0.27, 0.20)
LAWN_ALBEDO: Vector = (0.36, 0.47, 0.20)

LEAST_TRIANGLES = 60_000
"""Half as many again as all that is not green."""


class Backyard(ScenePlugin):
    """See the module."""

    name = "backyard"
    title = "Backyard"
    source = "after Annen et al. 2008, Figure 1"

    class Parameters(ParameterModel):
        """The scene's size and seed."""

        triangles: int = parameter(
            150_000,
            unit="triangles",
            help="Of the whole scene; more of them make more and smaller leaves of the same area.",
            ge=LEAST_TRIANGLES,
            le=4_000_000,
        )
        seed: int = parameter(1, unit="1", help="Another seed grows other plants and lays other tiles.", ge=0, lt=2**32)

    def make(self, parameters: BaseModel) -> Scene:
        """Build, furnish and plant the yard."""
        assert isinstance(parameters, self.Parameters)
        draw = UniformDraws(parameters.seed)
        setting = Setting()
        setting.add("lawn", rectangle((-12.0, 12.0), (-13.0, 11.0)), LAWN_ALBEDO)
        for name, shape, albedo in HOUSE.parts(draw):
            setting.add(name, shape, albedo, (0.0, 0.0, HOUSE_FRONT, 0.0))
        _lay_patio(setting, draw)
        _raise_pergola(setting)
        _furnish(setting)
        _fence_in(setting)
        _plant(setting, draw, parameters.triangles)
        return setting.scene(LIGHTS, CAMERAS)


def _lay_patio(setting: Setting, draw: UniformDraws) -> None:
    """Pave the patio, and lay stones to step on across the lawn."""
    for k, stones in enumerate(paving(draw, PATIO_X, PATIO_Z, (0.5, 0.5), 0.014, PATIO_TOP)):
        setting.add(f"paving {k + 1}", stones, STONES[k])
    steps = [(-0.7, -2.0), (0.0, -1.3), (0.6, -0.5), (1.3, 0.2), (2.0, 0.9), (2.8, 1.5), (3.6, 2.0)]
    stone = boxes((-0.28, 0.0, -0.2), (0.28, 0.03, 0.2))
    setting.add("stepping stone", stone, STONES, *[(x, 0.0, z, 35.0 * k) for k, (x, z) in enumerate(steps)])


BED: Place = (6.3, 0.0, 3.2, 25.0)
"""The raised bed, in which five rows of vegetables grow."""

PERGOLA_POSTS = (-7.9, -5.0, -2.1)
PERGOLA_Z = -2.75
_RAFTERS = np.linspace(-8.2, -1.8, 15)


def _raise_pergola(setting: Setting) -> None:
    """Raise posts, a beam, rafters from the house's wall, and battens across them."""
    parts = [boxes((x - 0.06, PATIO_TOP, PERGOLA_Z - 0.06), (x + 0.06, 2.38, PERGOLA_Z + 0.06)) for x in PERGOLA_POSTS]
    parts.append(boxes((-8.5, 2.38, PERGOLA_Z - 0.05), (-1.5, 2.54, PERGOLA_Z + 0.05)))
    parts.append(boxes((-8.4, 2.52, HOUSE_FRONT), (-1.6, 2.68, HOUSE_FRONT + 0.05)))
    ends = [
        np.stack([_RAFTERS, np.full(15, y), np.full(15, z)], axis=1)
        for y, z in ((2.75, HOUSE_FRONT + 0.02), (2.6, -2.3))
    ]
    parts.append(bars(ends[0], ends[1], 0.05, 0.12))
    z = np.linspace(HOUSE_FRONT + 0.3, -2.45, 10)
    y = 2.75 - 0.15 * (z - HOUSE_FRONT - 0.02) / 4.18 + 0.08
    ends = [np.stack([np.full(10, x), y, z], axis=1) for x in (-8.45, -1.55)]
    parts.append(bars(ends[0], ends[1], 0.04, 0.04))
    setting.add("pergola", joined(parts), WOODS[1])


def _furnish(setting: Setting) -> None:
    """Set up table, chairs, bench, parasol, washing and what else stands about."""
    floor, table_x, table_z = PATIO_TOP, -5.6, -4.45
    setting.add("table", furniture.table(1.9, 0.95), WOODS[0], (table_x, floor, table_z, 0.0))
    chairs = [(-6.1, -5.1, 4.0), (-5.05, -5.08, -3.0), (-6.05, -3.78, 176.0), (-4.85, -3.55, 155.0)]
    setting.add("chair", furniture.seat(0.46), WOODS, *[(x, floor, z, turn) for x, z, turn in chairs])
    top = floor + 0.74
    setting.add("bowl", furniture.bowl(0.17), (0.82, 0.82, 0.86), (table_x + 0.05, top, table_z + 0.02, 0.0))
    setting.add("apples", furniture.apples(0.042), (0.66, 0.16, 0.10), (table_x + 0.05, top, table_z + 0.02, 0.0))
    setting.add("bottle", furniture.bottle(), (0.10, 0.26, 0.13), (table_x + 0.42, top, table_z - 0.12, 0.0))
    glasses = [(-0.5, -0.22), (0.5, -0.26), (-0.45, 0.24), (0.62, 0.2)]
    setting.add(
        "glass", furniture.glass(), (0.75, 0.82, 0.86), *[(table_x + x, top, table_z + z, 0.0) for x, z in glasses]
    )
    setting.add("bench", furniture.seat(1.6, arms=True), WOODS[1], (9.75, 0.0, 1.0, -90.0))
    setting.add("deck chair", furniture.deck_chair(), (0.80, 0.66, 0.45), (2.9, 0.0, 3.6, 40.0))
    setting.add("parasol pole", furniture.parasol_pole(2.4), (0.85, 0.83, 0.80), (1.7, 0.0, 4.2, 0.0))
    setting.add("parasol", furniture.parasol_cloth(2.4), (0.80, 0.30, 0.22), (1.7, 0.0, 4.2, 0.0))
    setting.add("side table", furniture.table(0.5, 0.5, 0.45, 5), WOODS[0], (2.05, 0.0, 3.25, 40.0))
    setting.add("kennel", furniture.kennel(), (0.55, 0.33, 0.24), (9.4, 0.0, -4.6, -60.0))
    setting.add("ball", sphere(0.16, 32, 16), (0.85, 0.55, 0.15), (4.3, 0.16, 0.4, 0.0))
    setting.add("raised bed", furniture.raised_bed(2.6, 1.2, 0.28), WOODS[1], BED)
    setting.add("earth", furniture.earth(2.6, 1.2, 0.24), (0.30, 0.22, 0.16), BED)
    crates: list[Place] = [(-1.62, floor, -6.1, 3.0), (-1.6, floor + 0.36, -6.12, -9.0), (-2.25, floor, -6.16, 0.0)]
    setting.add("crate", furniture.crate(0.5, 0.36, 0.42), WOODS, *crates)
    setting.add("watering can", furniture.watering_can(), (0.45, 0.55, 0.60), (-1.75, floor, -5.05, 215.0))
    setting.add("ladder", furniture.ladder(2.6, 0.8), WOODS[0], (3.25, 0.0, -6.95, 30.0))
    broom = [bars((-3.05, floor, -6.12), (-2.98, 1.5, -6.485), 0.026, 0.026, up=(0.0, 0.0, 1.0))]
    broom.append(boxes((-3.2, floor, -6.16), (-2.9, floor + 0.1, -6.08)))
    setting.add("broom", joined(broom), (0.70, 0.55, 0.32))
    _hang_washing(setting)


def _hang_washing(setting: Setting) -> None:
    """Hang three cloths on a sagging line between two posts."""
    left, right = (4.3, -4.2), (8.6, -2.2)
    parts = []
    for x, z in (left, right):
        parts.append(tubes([[(x, 0.0, z), (x, 2.15, z)]], 0.035, 10))
        parts.append(bars((x - 0.06, 2.12, z - 0.36), (x + 0.06, 2.12, z + 0.36), 0.05, 0.05))
    share = np.linspace(0.0, 1.0, 17)
    sag = 2.15 - 0.3 * 4.0 * share * (1.0 - share)
    line = np.stack([left[0] + 4.3 * share, sag, left[1] + 2.0 * share], axis=1)
    parts.append(tubes(line[None], 0.006, 5))
    setting.add("washing line", joined(parts), (0.55, 0.55, 0.56))
    cloths: list[tuple[float, float, float, Vector]] = [
        (0.22, 1.3, 1.1, (0.88, 0.88, 0.90)),
        (0.51, 0.9, 0.8, (0.45, 0.60, 0.78)),
        (0.78, 1.35, 1.15, (0.86, 0.74, 0.52)),
    ]
    for k, (at, width, drop, albedo) in enumerate(cloths):
        level = 2.15 - 1.2 * at * (1.0 - at) - 0.01
        place = (left[0] + 4.3 * at, level, left[1] + 2.0 * at, -24.94)
        setting.add(f"washing {k + 1}", furniture.laundry(width, drop, 2.5 + k), albedo, place)


def _fence_in(setting: Setting) -> None:
    """Fence the yard in: behind, on the right and on the left."""
    panel = furniture.picket_fence(2.4, 1.25, 0.13)
    behind: list[Place] = [(-0.95 + 2.4 * k, 0.0, -11.6, 0.0) for k in range(5)]
    right: list[Place] = [(11.0, 0.0, -11.6 + 2.4 * k, -90.0) for k in range(9)]
    left: list[Place] = [(-10.4, 0.0, -6.4 + 2.4 * (k + 1), 90.0) for k in range(7)]
    setting.add("fence", panel, PICKET_ALBEDO, *behind, *right, *left)


class _Pot(NamedTuple):
    x: float
    z: float
    radius: float
    height: float
    plant: float
    """How high its plant is."""


POTS = (
    _Pot(-3.05, -5.3, 0.2, 0.34, 0.55),
    _Pot(-2.3, -5.15, 0.15, 0.26, 0.4),
    _Pot(-1.6, -4.3, 0.24, 0.42, 0.8),
    _Pot(-1.55, -3.6, 0.17, 0.28, 0.45),
    _Pot(-7.85, -6.1, 0.22, 0.4, 0.7),
    _Pot(-8.0, -5.4, 0.16, 0.28, 0.45),
    _Pot(-4.75, -6.2, 0.16, 0.3, 0.6),
    _Pot(-2.6, -2.9, 0.2, 0.32, 0.5),
)

POT_PLANTS = tuple(Bush(p.x, PATIO_TOP + p.height - 0.08, p.z, 0.42 * p.plant, p.plant) for p in POTS)

BUSHES = (
    Bush(-9.5, 0.0, -5.3, 0.75, 1.3),
    Bush(-9.4, 0.0, -3.6, 0.9, 1.6),
    Bush(-9.5, 0.0, -1.7, 0.8, 1.3),
    Bush(6.3, 0.0, -10.6, 0.8, 1.4),
    Bush(10.0, 0.0, -6.9, 0.95, 1.7),
    Bush(9.9, 0.0, -9.6, 1.0, 1.9),
    Bush(-0.2, 0.0, -10.5, 0.8, 1.4),
    Bush(8.0, 0.0, -10.8, 0.75, 1.3),
)

SALADS = tuple(Bush(-1.04 + 0.52 * i, 0.235, -0.42 + 0.28 * j, 0.14, 0.2) for i in range(5) for j in range(4))
"""In the raised bed's earth."""

TREE: Place = (3.1, 0.0, -7.2, 0.0)

GRASS_EDGES = (
    (-10.3, 9.6, -10.3, -6.0),
    (10.7, -11.3, 10.7, 9.6),
    (-0.9, -11.3, 10.8, -11.3),
    (-8.3, -2.42, -1.2, -2.42),
    (-1.1, -6.4, -1.1, -2.5),
)
"""Where grass is left to grow, along the fences and the patio: from (x, z) to (x, z)."""


def _plant(setting: Setting, draw: UniformDraws, triangles: int) -> None:
    """Plant the tree, the vine, the pots, the bushes and the grass, which use up the triangles that are left."""
    for pot in POTS:
        shape = furniture.pot(pot.radius, pot.height)
        setting.add("pot", shape, TERRACOTTA[int(10.0 * pot.radius) % 3], (pot.x, PATIO_TOP, pot.z, 0.0))
    setting.add("stems", bush_stems(draw, POT_PLANTS + BUSHES), BARK_ALBEDO)
    setting.add("vine stems", _vine_stems(draw), BARK_ALBEDO)
    left = triangles - setting.triangle_count
    wood, crown = tree(int(0.42 * left), draw, 7.0, sink=0.1)
    setting.add("tree", wood, BARK_ALBEDO, TREE)
    setting.add("tree leaves", crown, GREENS[0], TREE)
    setting.add("vine leaves", _vine_leaves(draw, int(0.2 * left)), GREENS[1])
    for k in range(2):
        setting.add(f"potted plants {k + 1}", bushes(draw, int(0.035 * left), POT_PLANTS[k::2], 2.6), GREENS[3 - k])
        setting.add(f"bushes {k + 1}", bushes(draw, int(0.08 * left), BUSHES[k::2], 9.0), GREENS[2 - k])
    setting.add("vegetables", bushes(draw, int(0.08 * left), SALADS, 6.4), GREENS[1], BED)
    left = triangles - setting.triangle_count
    tuft_count = max(6, left // 42)
    edge_count = 5 * tuft_count // 6  # the others have seeded themselves in the lawn
    lawn = [within(draw, tuft_count - edge_count, low, high) for low, high in ((-8.5, 10.0), (-1.8, 9.0))]
    centres = np.concatenate([along(draw, edge_count, GRASS_EDGES), np.stack(lawn, axis=1)])
    width = 0.012 * math.sqrt(12_000.0 / max(left, 12_000))
    setting.add("grass", tufts(draw, left, centres, 0.11, 0.24, width), GREENS[3])


def _vine_stems(draw: UniformDraws) -> Shape:
    """Return the stems that wind up the pergola's posts and on over its battens."""
    share = np.linspace(0.0, 1.0, 25)
    paths = []
    for x in PERGOLA_POSTS[:2]:
        wobble = 0.03 * (draw.unit_interval(25) - 0.5)
        up = np.minimum(share / 0.4, 1.0)
        back = np.maximum(share - 0.4, 0.0) / 0.6
        height = PATIO_TOP + 2.68 * up + 0.12 * back
        paths.append(np.stack([x + 0.09 + wobble + 0.5 * back, height, PERGOLA_Z + 0.02 - 3.2 * back + wobble], axis=1))
    return tubes(np.stack(paths), 0.028 * (1.0 - 0.7 * share), 7)


def _vine_leaves(draw: UniformDraws, triangle_count: int) -> Shape:
    """Return leaves in a rug over the pergola's left two thirds, thinner to the right, some hanging through."""
    count = -(-triangle_count // LEAF_TRIANGLES)
    x, y = draw.unit_interval(count), draw.unit_interval(count)
    rightwards = x * np.maximum(x, y)  # thins out towards 1
    z = within(draw, count, -6.0, -2.35)
    depth = draw.unit_interval(count)
    height = 2.76 + 0.22 * draw.unit_interval(count) - 0.4 * depth * depth * depth
    base = np.stack([-8.4 + 4.4 * rightwards, height, z], axis=1)
    outward = np.stack([within(draw, count, -1.0, 1.0), np.full(count, 0.2), within(draw, count, -1.0, 1.0)], axis=1)
    return leaves_about(draw, base, outward, leaf_length(count, 16.0), droop=0.5).first(triangle_count)
