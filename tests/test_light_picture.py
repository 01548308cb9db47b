"""Pictures of the light's image plane: points where the samples are, boxes where the cells are."""

import numpy as np

from shadowbench.light_picture import (
    CAPTION,
    SHEET_COLUMNS,
    SIDE,
    LightPlane,
    depth_picture,
    depth_sheet,
    light_space_pictures,
)

ORANGE, BLUE, GREY = (214, 137, 0), (24, 66, 130), (176, 176, 176)


def plane(places, is_lit, number=0, cells=()):
    places = np.array(places, np.float32)
    boxes = np.array(cells, np.float32).reshape(-1, 4)
    return LightPlane(number, places, np.arange(len(places), dtype=np.int32), np.array(is_lit), boxes)


def found(picture, colour):
    rows, columns = np.nonzero((picture == colour).all(axis=-1))
    return rows, columns


def test_a_sample_is_drawn_where_it_lies_in_the_colour_of_its_light():
    pictures = light_space_pictures([plane([(0.5, -0.5), (-0.75, 0.25)], [True, False])], 2, "BSP")
    rows, columns = found(pictures["samples in light space"], ORANGE)
    assert (rows.min(), columns.min()) == (SIDE // 4, 3 * SIDE // 4)
    rows, columns = found(pictures["samples in light space"], BLUE)
    assert (rows.min(), columns.min()) == (5 * SIDE // 8, SIDE // 8)


def test_cells_are_outlined_in_the_second_picture_only():
    pictures = light_space_pictures([plane([(0.0, 0.0)], [True], cells=[(-0.5, -0.5, 0.5, 0.0)])], 1, "cells")
    assert list(pictures) == ["samples in light space", "cells over the samples"]
    assert len(found(pictures["samples in light space"], GREY)[0]) == 0
    rows, columns = found(pictures["cells over the samples"], GREY)
    assert (rows.min(), rows.max()) == (SIDE // 4, SIDE // 2)
    assert (columns.min(), columns.max()) == (SIDE // 4, 3 * SIDE // 4)


def test_of_many_samples_an_even_share_is_drawn():
    count = 1024 * 768
    rng = np.random.default_rng(1)
    many = plane(rng.uniform(-0.99, 0.99, (count, 2)), np.ones(count, bool))
    picture = light_space_pictures([many], 1024, "BSP")["samples in light space"]
    drawn = len(found(picture, ORANGE)[0]) / 4.0  # four pixels each
    assert 0.85 * count / 64 < drawn <= count / 64


def test_six_windows_stand_side_by_side_and_no_samples_give_no_picture():
    pictures = light_space_pictures([plane([(0.0, 0.0)], [True], number=3)], 1, "BSP")
    picture = pictures["samples in light space"]
    assert picture.shape == (SIDE, 3 * SIDE // 2, 3)
    rows, columns = found(picture, ORANGE)
    assert (rows.min(), columns.min()) == (SIDE // 2 + SIDE // 4, SIDE // 2 + SIDE // 4)
    assert light_space_pictures([], 1, "BSP") == {}


def test_near_depths_are_darker_than_far_ones_and_empty_texels_white():
    depth = np.array([[[0.2, 0.4], [0.6, 1.0]]], np.float32)
    image = depth_picture(depth).astype(int)
    assert image.shape == (SIDE, SIDE, 3)
    near, middle, far, empty = (image[r, c, 0] for r in (0, -1) for c in (0, -1))
    assert near < middle < far < empty == 255
    assert abs((far - middle) - (middle - near)) <= 1  # linear in depth


def test_a_twig_of_one_texel_stays_in_a_large_depth_map():
    depth = np.full((1, 2 * SIDE, 2 * SIDE), 0.9, np.float32)
    depth[0, 301, 500] = 0.1
    rows, columns = np.nonzero(depth_picture(depth)[..., 0] < 50)
    assert (rows.tolist(), columns.tolist()) == ([150], [250])


def test_six_depth_maps_stand_as_the_faces_of_a_cube():
    depth = np.ones((6, 4, 4), np.float32)
    depth[3] = 0.5  # -y: below, in the middle
    image = depth_picture(depth)
    assert image.shape == (SIDE, SIDE // 2 * 3, 3)
    assert (image[SIDE * 3 // 4, SIDE * 3 // 4] < 255).all()
    assert (image[SIDE // 4, SIDE // 4] == 255).all()


def test_an_empty_depth_map_is_white():
    assert (depth_picture(np.ones((1, 3, 3), np.float32)) == 255).all()


def _cell(sheet, number, columns):
    side = SIDE // columns
    top, left = number // columns * (side + CAPTION), number % columns * side
    return sheet[top + 1 : top + side - 1, left + 1 : left + side - 1], sheet[top + side : top + side + CAPTION]


def test_a_sheet_shows_every_map_over_its_own_depths_with_its_name_below():
    shallow, deep = (np.full((1, 8, 8), far, np.float32) for far in (1.0e-4, 0.5))
    for depth in (shallow, deep):
        depth[0, :, :4] *= 0.5
    maps = [("shallow", shallow[0]), ("deep", deep[0]), ("empty", np.ones((8, 8), np.float32))]
    sheet = depth_sheet(maps)
    cells = [_cell(sheet, number, 2)[0] for number in range(4)]
    np.testing.assert_array_equal(cells[0], cells[1])
    assert cells[0][5, 5, 0] < cells[0][5, -5, 0] < 255
    assert (cells[2] == 255).all()
    assert (cells[3] == 255).all()
    names = [_cell(sheet, number, 2)[1] for number in (0, 2)]
    assert all((name < 200).any() for name in names)
    assert (names[0] != names[1]).any()


def test_a_sheet_says_how_many_maps_it_leaves_out_and_shortens_long_names():
    depth = np.full((2, 2), 0.5, np.float32)
    whole = depth_sheet([("a" * 500, depth)] * 30)
    assert whole.shape == (5 * (SIDE // SHEET_COLUMNS + CAPTION), SIDE, 3)
    side = SIDE // SHEET_COLUMNS
    assert (whole[side : side + CAPTION, side - 4 : side] == 255).all()  # no name runs into the next
    more = depth_sheet([("a", depth)] * 30, left_out=7)
    assert len(more) == len(whole) + CAPTION
    assert (more[-CAPTION:] < 200).any()
