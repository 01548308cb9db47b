"""Garden furniture and the house: of the size they are called by, standing on the ground, in one colour's parts."""

from __future__ import annotations

import numpy as np
import pytest
from mesh_files import is_closed, signed_volume
from scene_geometry import areas

from shadowbench.scenes import furniture
from shadowbench.scenes.backyard import HOUSE
from shadowbench.scenes.shapes import Shape
from shadowbench.scenes.uniform_draws import UniformDraws

STANDING = {
    "table": (furniture.table(1.9, 0.95), (1.9, 0.74, 0.95)),
    "chair": (furniture.seat(0.46), (0.46, 0.94, 0.63)),
    "bench": (furniture.seat(1.6, arms=True), (1.62, 0.94, 0.63)),
    "parasol pole": (furniture.parasol_pole(2.4), (2.64, 2.46, 2.64)),
    "pot": (furniture.pot(0.2, 0.35), (0.4, 0.35, 0.4)),
    "crate": (furniture.crate(0.5, 0.36, 0.42), (0.5, 0.36, 0.42)),
    "raised bed": (furniture.raised_bed(2.6, 1.2, 0.28), (2.63, 0.88, 1.23)),
    "picket fence": (furniture.picket_fence(2.4, 1.25, 0.13), (2.445, 1.29, 0.143)),
    "bottle": (furniture.bottle(), (0.074, 0.3, 0.074)),
    "glass": (furniture.glass(), (0.068, 0.185, 0.068)),
    "bowl": (furniture.bowl(0.17), (0.34, 0.107, 0.34)),
    "watering can": (furniture.watering_can(), (0.61, 0.387, 0.22)),
    "kennel": (furniture.kennel(), (1.0, 0.88, 1.16)),
}


@pytest.mark.parametrize("name", STANDING)
def test_it_stands_on_the_ground_and_has_its_size(name: str) -> None:
    shape, size = STANDING[name]
    low, high = shape.points.min(axis=0), shape.points.max(axis=0)
    assert low[1] == 0.0
    np.testing.assert_allclose(high - low, size, atol=0.03)
    assert areas(shape.points[shape.triangles]).min() > 1e-8


@pytest.mark.parametrize("shape", [furniture.deck_chair(), furniture.ladder(2.6, 0.8)])
def test_what_leans_has_its_feet_in_the_ground(shape: Shape) -> None:
    assert -0.025 < shape.points[:, 1].min() <= 0.0


@pytest.mark.parametrize(
    "shape",
    [furniture.pot(0.2, 0.35), furniture.bottle(), furniture.glass(), furniture.bowl(0.17), furniture.apples(0.04)],
)
def test_turned_things_are_closed_and_face_out(shape: Shape) -> None:
    assert is_closed(shape.triangles)
    assert signed_volume(shape.points, shape.triangles) > 0.0


@pytest.mark.parametrize("shape", [furniture.table(1.9, 0.95), furniture.seat(0.46), furniture.crate(0.5, 0.3, 0.4)])
def test_what_is_made_of_boards_is_made_of_closed_boards(shape: Shape) -> None:
    assert is_closed(shape.triangles)
    each = shape.points.reshape(-1, 8, 3)
    for board in each:
        solid = Shape(board, shape.triangles[:12])
        assert signed_volume(solid.points, solid.triangles) > 0.0


def test_a_picket_fence_has_a_picket_every_pitch_and_gaps_between() -> None:
    fence = furniture.picket_fence(2.4, 1.25, 0.12)
    tips = np.unique(fence.points[fence.points[:, 1] == 1.25][:, 0].round(9))
    np.testing.assert_allclose(np.diff(tips), 0.12)
    assert len(tips) == 20


def test_a_ladder_leans_with_rungs_between_its_rails() -> None:
    ladder = furniture.ladder(2.8, 0.8)
    top = ladder.points[ladder.points[:, 1] > 2.7]
    foot = ladder.points[ladder.points[:, 1] < 0.1]
    assert abs(top[:, 2].mean()) < 0.1
    assert foot[:, 2].mean() == pytest.approx(0.8, abs=0.1)


def test_a_parasols_cloth_lies_on_its_ribs_and_over_its_pole() -> None:
    cloth, pole = furniture.parasol_cloth(2.4), furniture.parasol_pole(2.4)
    assert np.hypot(cloth.points[:, 0], cloth.points[:, 2]).max() == pytest.approx(1.32)
    ribs = pole.points[np.hypot(pole.points[:, 0], pole.points[:, 2]) > 1.2]
    assert 0.0 < cloth.points[:, 1].max() - ribs[:, 1].max() < 0.6
    assert cloth.points[:, 1].max() < pole.points[:, 1].max()


def test_cloth_hangs_from_its_line_and_ripples() -> None:
    cloth = furniture.laundry(1.2, 1.0, 3.0)
    assert cloth.points[:, 1].max() == 0.0
    assert cloth.points[:, 1].min() == -1.0
    hem = cloth.points[cloth.points[:, 1] == -1.0][:, 2]
    assert hem.max() - hem.min() > 0.1


def test_the_house_has_a_closed_front_but_for_its_openings_and_stands_on_the_ground() -> None:
    parts = {name: shape for name, shape, _ in HOUSE.parts(UniformDraws(1))}
    walls = parts["house walls"]
    assert walls.points[:, 1].min() == 0.0
    assert walls.points[:, 1].max() == HOUSE.ridge
    holes = sum((x1 - x0) * (y1 - y0) for x0, x1, y0, y1 in (*HOUSE.windows, HOUSE.door))
    corners = walls.points[walls.triangles]
    facing = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, 2] > 0.0
    front = (corners[:, :, 2] == 0.0).all(axis=1) & facing
    whole = (HOUSE.x[1] - HOUSE.x[0]) * HOUSE.eaves
    assert areas(corners[front]).sum() == pytest.approx(whole - holes)


def test_roof_tiles_lie_over_the_roof_and_overlap() -> None:
    parts = {name: shape for name, shape, _ in HOUSE.parts(UniformDraws(1))}
    tiles = [shape for name, shape in parts.items() if name.startswith("roof tiles")]
    count = sum(shape.triangle_count for shape in tiles) // 12
    rise, half = HOUSE.ridge - HOUSE.eaves, HOUSE.depth / 2.0
    for shape in tiles:
        # above the slabs' outer faces: |z - ridge| and y on the line through eaves and ridge, raised by the slab
        below = HOUSE.ridge - np.abs(shape.points[:, 2] + half) * rise / half
        assert (shape.points[:, 1] > below + 0.14).all()
    roof = 2.0 * (HOUSE.x[1] - HOUSE.x[0]) * np.hypot(rise, half)
    assert count * 0.285 * 0.43 > roof
