import io
from dataclasses import replace

import numpy as np
from builders import SUN, box_over_ground, flat_receivers, stated_reference
from PIL import Image

from shadowbench.filtered_reference import FilteredReference
from shadowbench.pictures import (
    ERROR_COLOURS,
    FAILURE_COLOURS,
    UNSCORED_GREY,
    case_pictures,
    error_picture,
    failure_picture,
    heat_picture,
    shaded,
    to_srgb,
    towards,
)
from shadowbench.scene import PointLight


def test_a_shadowed_surface_is_darker_and_keeps_its_ambient_light():
    receivers = flat_receivers(8, 4)
    visibility = np.where(np.arange(32) % 8 < 4, 0.0, 1.0).astype(np.float32)
    image = shaded(box_over_ground(), SUN, receivers, visibility).astype(int)
    assert image.shape == (4, 8, 3)
    assert (image[:, :4] < image[:, 4:] - 30).all()
    assert (image[:, :4] > 20).all()


def test_directions_to_a_point_light_are_unit_and_point_at_it():
    receivers = flat_receivers(4, 4)
    light = PointLight((0.5, 2.0, -1.0))
    direction = towards(light, receivers.position)
    distance = np.linalg.norm(np.array(light.position) - receivers.position, axis=1)
    np.testing.assert_allclose(receivers.position + direction * distance[:, None], [light.position] * 16, atol=1e-6)


def test_the_tone_curve_rises_and_stays_in_range():
    values = to_srgb(np.linspace(0.0, 10.0, 4000)).astype(int)
    assert values[0] == 0
    assert values[-1] == 255
    assert (np.diff(values) >= 0).all()


def test_failures_are_painted_in_their_colours_and_later_classes_win():
    receivers = flat_receivers(4, 1)
    base = np.full((1, 4, 3), 200, np.uint8)
    masks = {
        "false_lit": np.array([True, True, False, False]),
        "peter_panning": np.array([False, True, False, False]),
    }
    image = failure_picture(base, receivers, masks)
    assert tuple(image[0, 0]) == FAILURE_COLOURS["false_lit"]
    assert tuple(image[0, 1]) == FAILURE_COLOURS["peter_panning"]
    assert image[0, 2, 0] == image[0, 2, 1] == image[0, 2, 2]


def test_numbers_are_painted_from_the_darkest_to_the_brightest_and_nothing_where_they_are_0():
    receivers = flat_receivers(8, 4)
    base = np.full((4, 8, 3), 200, np.uint8)
    values = np.arange(32) % 8
    image = heat_picture(base, receivers, values).astype(int)
    assert (image[:, 0] == 210).all()  # 110 + 200 / 2: faded grey
    brightness = image @ [0.2126, 0.7152, 0.0722]
    assert (np.diff(brightness[:, 1:], axis=1) > 0).all()
    assert (image[:, 1] == (68, 1, 84)).all()
    assert (image[:, 7] == (253, 231, 37)).all()
    assert (heat_picture(base, receivers, np.ones(32))[..., 0] == 68).all()


def test_a_pixel_of_several_receivers_shows_their_largest_number():
    receivers = flat_receivers(4, 1)
    twice = replace(receivers, pixel=np.array([0, 0, 1, 2], np.int32))
    base = np.full((1, 4, 3), 200, np.uint8)
    expected = heat_picture(base, receivers, np.array([5, 1, 3, 0]))
    np.testing.assert_array_equal(heat_picture(base, twice, np.array([2, 5, 1, 3])), expected)


def test_every_mask_comes_out_as_a_picture():
    receivers = flat_receivers(8, 4)
    truth = np.ones(32, np.float32)
    mask = np.arange(32) % 5 == 0
    pictures = case_pictures(box_over_ground(), SUN, receivers, stated_reference(truth), truth, {"false_shadow": mask})
    assert set(pictures) == {"result", "reference", "failures", "mask-false-shadow"}
    shown = np.asarray(Image.open(io.BytesIO(pictures["mask-false-shadow"])))
    assert (shown.reshape(-1) == mask).all()
    assert pictures["result"] == pictures["reference"]


def test_numbers_by_receiver_come_out_as_heat_maps():
    receivers = flat_receivers(8, 4)
    truth = np.ones(32, np.float32)
    numbers = {"largest fill": np.arange(32)}
    pictures = case_pictures(box_over_ground(), SUN, receivers, stated_reference(truth), truth, {}, numbers)
    assert set(pictures) == {"result", "reference", "failures", "picture-largest fill"}
    shown = np.asarray(Image.open(io.BytesIO(pictures["picture-largest fill"])))
    assert tuple(shown[3, 7]) == (253, 231, 37)


def test_errors_are_blue_where_too_dark_and_orange_where_too_lit():
    receivers = flat_receivers(6, 1)
    error = np.array([-1.0, -0.04, 0.0, 0.04, 1.0, 0.5])
    image = error_picture(receivers, np.arange(6) < 5, error)[0].astype(int)
    dark, right, lit = (np.array(colour) for colour in ERROR_COLOURS)
    assert (image[0] == dark).all()
    assert (image[2] == right).all()
    assert (image[4] == lit).all()
    assert (image[5] == UNSCORED_GREY).all()
    # a small error is told from none: its colour has the root's strength
    np.testing.assert_allclose(image[1], right + 0.2 * (dark - right), atol=1)
    np.testing.assert_allclose(image[3], right + 0.2 * (lit - right), atol=1)


def test_of_errors_in_colours_the_largest_is_shown():
    receivers = flat_receivers(2, 1)
    error = np.array([[0.1, -0.5, 0.2], [0.3, 0.0, -0.1]])
    alone = error_picture(receivers, np.ones(2, bool), np.array([-0.5, 0.3]))
    assert (error_picture(receivers, np.ones(2, bool), error) == alone).all()


def test_a_filtering_methods_pictures_show_its_own_reference_and_its_error():
    receivers = flat_receivers(8, 4)
    truth, soft = np.ones(32, np.float32), np.full(32, 0.5, np.float32)
    filtered = FilteredReference(soft, np.zeros_like(soft))
    pictures = case_pictures(box_over_ground(), SUN, receivers, stated_reference(truth), soft, {}, filtered=filtered)
    assert set(pictures) == {"result", "reference", "failures", "filtered-reference", "error"}
    assert pictures["filtered-reference"] == pictures["result"] != pictures["reference"]
    image = np.asarray(Image.open(io.BytesIO(pictures["error"])))
    assert (image == ERROR_COLOURS[1]).all()
