"""What stands about in a garden: tables, chairs, benches, a parasol, pots, crates, a ladder, things on a table.

Everything stands on y = 0, over the origin, and looks along +z where it has a front. Lengths are in metres.
"""

from __future__ import annotations

import numpy as np

from shadowbench.scene import cosine_sine

from .shapes import Shape, bars, boxes, cylinder, joined, prism, rectangle, revolved, sheet, sphere
from .tubes import tubes
from .vectors import Array, unit

DEPTH = (0.0, 0.0, 1.0)
"""The "up" of bars that are upright themselves: their thickness lies along z."""


def table(length: float, width: float, height: float = 0.74, slats: int = 7) -> Shape:
    """Return a slatted table on four legs with aprons: its top's gaps let thin stripes of light through."""
    x, z, under = length / 2.0 - 0.09, width / 2.0 - 0.09, height - 0.03
    step = width / slats
    z0 = step * np.arange(slats) - width / 2.0 + 0.008
    zeros = np.zeros(slats)
    top = boxes(
        np.stack([zeros - length / 2.0, zeros + under, z0], axis=1),
        np.stack([zeros + length / 2.0, zeros + height, z0 + step - 0.016], axis=1),
    )
    legs = [_post(sx * x, sz * z, 0.035, 0.0, under) for sx, sz in _FOUR]
    aprons = [boxes((-x, under - 0.09, sz * z - 0.012), (x, under, sz * z + 0.012)) for sz in (-1.0, 1.0)]
    aprons += [boxes((sx * x - 0.012, under - 0.09, -z), (sx * x + 0.012, under, z)) for sx in (-1.0, 1.0)]
    return joined([top, *legs, *aprons])


_FOUR = [(-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0), (1.0, 1.0)]
"""The signs of x and z at the corners of a level rectangle."""


def _post(x: float, z: float, half: float, low: float, high: float) -> Shape:
    return boxes((x - half, low, z - half), (x + half, high, z + half))


def seat(length: float, *, arms: bool = False) -> Shape:
    """Return a slatted chair (or, if long, a bench) with a leaning back: the sitter looks along +z."""
    half = length / 2.0
    parts = []
    for x in (-half + 0.03, half - 0.03):
        parts.append(boxes((x - 0.022, 0.0, 0.185), (x + 0.022, 0.41, 0.23)))
        parts.append(boxes((x - 0.022, 0.0, -0.215), (x + 0.022, 0.41, -0.17)))
        parts.append(bars((x, 0.40, -0.195), (x, 0.93, -0.34), 0.044, 0.04, up=DEPTH))
        parts.append(boxes((x - 0.018, 0.36, -0.17), (x + 0.018, 0.41, 0.185)))
        if arms:
            parts.append(boxes((x - 0.02, 0.41, 0.19), (x + 0.02, 0.63, 0.225)))
            parts.append(boxes((x - 0.035, 0.63, -0.25), (x + 0.035, 0.66, 0.26)))
    z = np.linspace(-0.165, 0.215, 6)
    low = np.stack([np.full(6, -half), np.full(6, 0.41), z - 0.028], axis=1)
    parts.append(boxes(low, low + np.array([length, 0.02, 0.056])))
    y = np.array([0.56, 0.66, 0.76, 0.86])
    back = np.stack([np.zeros(4), y, -0.195 - (y - 0.40) * 0.2736 + 0.029], axis=1)
    ends = np.array([half, 0.0, 0.0])
    parts.append(bars(back - ends, back + ends, 0.07, 0.016, up=unit((0.0, 0.2736, 1.0))))
    return joined(parts)


def deck_chair() -> Shape:
    """Return a deck chair: two crossed frames and a sagging cloth, a slanted and curved receiver."""
    parts = []
    for x in (-0.29, 0.29):
        inner = 0.035 if x < 0.0 else -0.035
        parts.append(bars((x, 0.0, 0.52), (x, 0.92, -0.56), 0.03, 0.04, up=DEPTH))
        parts.append(bars((x + inner, 0.0, -0.50), (x + inner, 0.40, 0.48), 0.03, 0.04, up=DEPTH))
    # sunk by half a rod, so that a rod's underside is what touches the ground
    for y, z, half in ((0.92, -0.56, 0.305), (0.40, 0.48, 0.27), (0.03, 0.485, 0.29), (0.03, -0.43, 0.255)):
        parts.append(tubes([[(-half, y, z), (half, y, z)]], 0.016, 8))
    share = np.linspace(0.0, 1.0, 17)
    sag = 4.0 * share * (1.0 - share)
    line = np.stack([0.92 - 0.52 * share - 0.17 * sag, -0.56 + 1.04 * share - 0.05 * sag], axis=1)
    cloth = np.zeros((17, 9, 3))
    cloth[:, :, 0] = np.linspace(-0.23, 0.23, 9)
    cloth[:, :, 1:] = line[:, None]
    parts.append(sheet(cloth))
    return joined(parts)


def parasol_pole(height: float) -> Shape:
    """Return a parasol's foot, pole, and the ribs that carry its cloth."""
    ribs = np.stack([*_rib_ends(height)], axis=1)
    inner = ribs[:, 0] + 0.45 * (ribs[:, 1] - ribs[:, 0])
    struts = np.stack([inner, np.tile([0.0, height - 0.78, 0.0], (8, 1))], axis=1)
    return joined(
        [
            revolved([(0.0, 0.0), (0.26, 0.0), (0.26, 0.05), (0.06, 0.09), (0.0, 0.09)], 32),
            cylinder(0.022, 0.08, height + 0.06, 12),
            tubes(np.concatenate([ribs, struts]), 0.008, 4),
        ]
    )


def _rib_ends(height: float) -> tuple[Array, Array]:
    cosine, sine = cosine_sine(45.0 * np.arange(8))
    hub = np.tile([0.0, height - 0.012, 0.0], (8, 1))
    return hub, np.stack([1.32 * cosine, np.full(8, height - 0.46), -1.32 * sine], axis=1)


def parasol_cloth(height: float) -> Shape:
    """Return a parasol's eight panels with a hem, hung between the ribs, as one thin sheet."""
    hub, tip = (ends[:, None, None] for ends in _rib_ends(height))
    beside = np.roll(tip, -1, axis=0)
    outwards = np.array([0.04, 0.25, 0.5, 0.75, 1.0])[:, None, None]
    sideways = np.linspace(0.0, 1.0, 5)[:, None]
    rim = tip + sideways * (beside - tip)
    sag = 4.0 * sideways * (1.0 - sideways)
    points = hub + outwards * (rim - hub) + np.array([0.0, 0.012, 0.0]) - 0.05 * sag * outwards * np.array([0, 1.0, 0])
    hem = points[:, -1:] - np.array([0.0, 0.14, 0.0]) * (0.7 + 0.3 * sag)
    return joined(sheet(panel) for panel in np.concatenate([points, hem], axis=1))


def pot(radius: float, height: float) -> Shape:
    """Return a flower pot with a rim, filled with earth to a little below it."""
    foot, rim = 0.68 * radius, 0.16 * height
    return revolved(
        [
            (0.0, 0.0),
            (foot, 0.0),
            (0.93 * radius, height - rim),
            (radius, height - rim),
            (radius, height),
            (0.86 * radius, height),
            (0.84 * radius, height - 0.6 * rim),
            (0.0, height - 0.5 * rim),
        ],
        32,
    )


def raised_bed(length: float, width: float, height: float) -> Shape:
    """Return the boards and corner posts of a raised bed, and the stakes and strings over it."""
    x, z = length / 2.0, width / 2.0
    parts = [boxes((-x, 0.0, s * z - 0.015), (x, height, s * z + 0.015)) for s in (-1.0, 1.0)]
    parts += [boxes((s * x - 0.015, 0.0, 0.015 - z), (s * x + 0.015, height, z - 0.015)) for s in (-1.0, 1.0)]
    parts += [_post(sx * (x - 0.04), sz * (z - 0.04), 0.025, 0.0, height + 0.05) for sx, sz in _FOUR]
    ends = [np.array([[s * (x - 0.1), 0.0, 0.0], [s * (x - 0.1), height + 0.6, 0.0]]) for s in (-1.0, 1.0)]
    parts.append(tubes(np.stack(ends), 0.012, 6))
    parts.append(tubes([[(0.1 - x, height + 0.55, 0.0), (x - 0.1, height + 0.55, 0.0)]], 0.003, 4))
    return joined(parts)


def earth(length: float, width: float, height: float) -> Shape:
    """Return the earth in a raised bed: its surface only, which is what there is to see."""
    x, z = length / 2.0 - 0.015, width / 2.0 - 0.015
    return rectangle((-x, x), (-z, z), height)


def crate(width: float, height: float, depth: float) -> Shape:
    """Return a slatted crate, open above, whose gaps throw stripes."""
    x, z = width / 2.0, depth / 2.0
    parts = [boxes((-x + 0.012, 0.0, -z + 0.012), (x - 0.012, 0.014, z - 0.012))]
    parts += [_post(sx * (x - 0.027), sz * (z - 0.027), 0.015, 0.014, height) for sx, sz in _FOUR]
    slats = max(3, round(height / 0.09))
    step = height / slats
    for k in range(slats):
        y0, y1 = k * step + (0.0 if k == 0 else 0.012), (k + 1) * step
        parts += [boxes((-x, y0, s * (z - 0.006) - 0.006), (x, y1, s * (z - 0.006) + 0.006)) for s in (-1.0, 1.0)]
        ends = z - 0.012
        parts += [boxes((s * (x - 0.006) - 0.006, y0, -ends), (s * (x - 0.006) + 0.006, y1, ends)) for s in (-1.0, 1.0)]
    return joined(parts)


def ladder(height: float, lean: float) -> Shape:
    """Return a ladder that leans back over ``lean``: its feet stand at z = lean, its top touches z = 0."""
    rungs = int(height / 0.28)
    share = (np.arange(rungs) + 0.7) / rungs
    middle = np.stack([np.zeros(rungs), share * height, lean * (1.0 - share)], axis=1)
    side = np.array([0.2, 0.0, 0.0])
    rails = [bars((x, 0.0, lean), (x, height, 0.0), 0.03, 0.06, up=DEPTH) for x in (-0.2, 0.2)]
    return joined([*rails, tubes(np.stack([middle - side, middle + side], axis=1), 0.014, 8)])


def picket_fence(length: float, height: float, pitch: float) -> Shape:
    """Return a length of picket fence along x, in front of its rails and one post (at its beginning)."""
    count = round(length / pitch)
    half, tip = 0.36 * pitch, height - 0.06
    picket = prism([(-half, 0.05), (half, 0.05), (half, tip), (0.0, height), (-half, tip)], 0.0, 0.018)
    pickets = [picket.moved(x=(k + 0.5) * length / count) for k in range(count)]
    rails = [boxes((0.0, y, -0.035), (length, y + 0.08, 0.0)) for y in (0.22, height - 0.38)]
    post = boxes((-0.045, 0.0, -0.125), (0.045, height + 0.04, -0.035))
    return joined([*pickets, *rails, post])


def bottle() -> Shape:
    """Return a wine bottle."""
    return revolved(
        [(0.0, 0.0), (0.037, 0.0), (0.037, 0.19), (0.03, 0.215), (0.0145, 0.235), (0.0145, 0.3), (0.0, 0.3)], 24
    )


def glass() -> Shape:
    """Return a stemmed glass, open above and with a wall."""
    outside = [(0.0, 0.0), (0.034, 0.0), (0.033, 0.004), (0.005, 0.008), (0.0045, 0.08), (0.028, 0.105), (0.034, 0.14)]
    return revolved([*outside, (0.03, 0.185), (0.0275, 0.185), (0.031, 0.14), (0.025, 0.108), (0.0, 0.092)], 24)


def bowl(radius: float) -> Shape:
    """Return a bowl with a foot and a wall."""
    shares = np.linspace(0.0, 1.0, 7)
    outside = [(radius * (0.4 + 0.6 * s), 0.012 + 0.5 * radius * s * s) for s in shares]
    inside = [(radius * (0.37 + 0.58 * s), 0.022 + 0.485 * radius * s * s) for s in shares[::-1]]
    return revolved([(0.0, 0.0), (0.4 * radius, 0.0), *outside, *inside, (0.0, 0.02)], 32)


def apples(radius: float) -> Shape:
    """Return four apples that lie in a bowl."""
    ball = sphere(radius, 16, 8)
    at = [(0.9, 0.0), (-0.55, 0.95), (-0.55, -0.95)]
    ring = [ball.moved(1.16 * radius * x, 1.0 * radius + 0.024, 1.16 * radius * z) for x, z in at]
    return joined([*ring, ball.moved(y=2.45 * radius + 0.024)])


def watering_can() -> Shape:
    """Return a watering can: body, spout with a rose, and a handle."""
    body = revolved([(0.0, 0.0), (0.11, 0.0), (0.11, 0.24), (0.1, 0.25), (0.1, 0.235), (0.0, 0.23)], 32)
    spout = tubes([[(0.09, 0.06, 0.0), (0.2, 0.15, 0.0), (0.34, 0.33, 0.0)]], [[0.026, 0.02, 0.014]], 12)
    rose = tubes([[(0.335, 0.322, 0.0), (0.365, 0.362, 0.0)]], [[0.014, 0.04]], 16)
    cosine, sine = cosine_sine(np.linspace(-60.0, 150.0, 12))
    arc = np.stack([-0.1 - 0.11 * cosine, 0.17 + 0.12 * sine, np.zeros(12)], axis=1)
    return joined([body, spout, rose, tubes(arc[None], 0.009, 8)])


def kennel() -> Shape:
    """Return a dog's kennel: boards with a dark way in, and a roof of two overhanging slopes."""
    front = prism([(-0.4, 0.0), (-0.16, 0.0), (-0.16, 0.42), (-0.4, 0.42)], 0.0, 0.02)
    parts = [front.moved(z=0.48), front.moved(x=0.56, z=0.48)]
    gable = [(-0.4, 0.42), (0.4, 0.42), (0.4, 0.58), (0.0, 0.86), (-0.4, 0.58)]
    parts.append(prism(gable, 0.48, 0.5))
    parts.append(prism([(-0.4, 0.0), (0.4, 0.0), *gable[2:]], -0.5, -0.48))
    parts += [boxes((x - 0.01, 0.0, -0.48), (x + 0.01, 0.585, 0.48)) for x in (-0.39, 0.39)]
    parts.append(boxes((-0.38, 0.0, -0.48), (0.38, 0.03, 0.48)))
    for side in (-1.0, 1.0):
        normal = unit((0.7 * side, 1.0, 0.0))
        low, high = np.array([side * 0.5, 0.51, 0.0]), np.array([0.0, 0.86, 0.0])
        middle = (low + high) / 2.0 + 0.0125 * normal
        along = np.array([0.0, 0.0, 0.58])
        parts.append(bars(middle - along, middle + along, 0.6104, 0.025, up=normal))
    return joined(parts)


def laundry(width: float, drop: float, waves: float) -> Shape:
    """Return a cloth hung from y = 0, rippled so that no part of it faces the light alike."""
    rows, columns = 13, 29
    down, aside = np.meshgrid(np.linspace(0.0, 1.0, rows), np.linspace(0.0, 1.0, columns), indexing="ij")
    ripple, _ = cosine_sine(360.0 * waves * aside + 40.0 * down)
    points = np.stack([width * (aside - 0.5), -drop * down, (0.015 + 0.05 * down) * ripple], axis=2)
    return sheet(points)
