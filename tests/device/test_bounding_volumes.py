"""Shadow volumes of boxes against the closed form of a box's shadow, and their outlines against the convex hull."""

from __future__ import annotations

import numpy as np
import pytest
from builders import flat_receivers, square
from oracles import is_behind_box
from surfaces import world_of

from shadowbench.camera_pass import render
from shadowbench.device.bounding_volumes import BoundingVolumes, OrientedBoxes
from shadowbench.device.launch import Context
from shadowbench.light_space import camera_frame
from shadowbench.scene import Camera, DirectionalLight

SUN = (0.4, 1.0, 0.3, 0.0)
LAMP = (0.9, 2.4, 0.7, 1.0)
WORLD = world_of(square(4.0), square(0.5, 3.0), lights={"sun": DirectionalLight(SUN[:3])})


def _random_boxes(count, rng, *, largest=1.0):
    turn, _ = np.linalg.qr(rng.normal(size=(count, 3, 3)))
    scale = rng.uniform(0.2, 2.0, (count, 1, 3)) * rng.choice((-1.0, 1.0), (count, 1, 3))
    half = rng.uniform(0.05, largest, (count, 3))
    half[rng.random((count, 3)) < 0.05] = 0.0  # flat ones
    centre = rng.uniform((-1.5, 0.3, -1.5), (1.5, 2.5, 1.5), (count, 3))
    return OrientedBoxes(half, turn * scale, np.linalg.inv(turn * scale), centre)


def _random_light(rng):
    if rng.random() < 0.5:
        return (*(rng.normal(size=3) * rng.choice((0.0, 1.0), 3, p=(0.2, 0.8)) + (0.0, 1e-3, 0.0)), 0.0)
    return (*rng.uniform((-2.0, 0.0, -2.0), (2.0, 4.0, 2.0)), 1.0)


def _outlined(boxes, light, camera=None, size=(80, 60), **changes):
    """Volumes outlined in a picture of the ground, and the receivers."""
    camera = camera or Camera((0.3, 3.0, 6.0), (0.0, 0.5, 0.0))
    receivers = render(WORLD, camera, *size, Context())
    volumes = BoundingVolumes(boxes, light, WORLD, Context())
    frame = camera_frame(camera, *size, WORLD)
    volumes.outline(receivers, frame, **({"exits_first": False} | changes))
    return volumes, receivers, frame


def _is_inside(volumes, box, points, *, only_leading=False):
    counts = volumes.plane_counts.numpy()[box]
    planes = volumes.planes.numpy()[box, : counts[0 if only_leading else 1]]
    return (points @ planes[:, :3].T + planes[:, 3] <= 0.0).all(axis=1)


def _is_behind(boxes, box, points, light, margin):
    """The closed form, in the box's own space; a positive margin [scene units] makes the box larger."""
    to_box = boxes.box_from_world[box]
    in_box = (points - boxes.centre[box]) @ to_box.T
    towards = to_box @ (np.array(light[:3]) - light[3] * boxes.centre[box])
    grown = boxes.half[box] + margin * np.linalg.norm(to_box, axis=1)
    if (grown <= 0.0).any():
        return np.zeros(len(points), bool)
    return is_behind_box(in_box, -grown, grown, (*towards, light[3]))


@pytest.mark.parametrize("seed", range(4))
def test_a_point_is_in_the_volume_if_and_only_if_the_box_is_between_it_and_the_light(seed):
    rng = np.random.default_rng(seed)
    seen = 0
    for _ in range(25):
        boxes, light = _random_boxes(8, rng), _random_light(rng)
        volumes, _, _ = _outlined(boxes, light)
        for box in range(8):
            # about the box, and along its shadow
            around = boxes.centre[box] + rng.normal(size=(300, 3)) * 1.5
            points = around + rng.uniform(0.0, 3.0, (300, 1)) * (light[3] * around - np.array(light[:3]))
            points = np.concatenate([around, points])
            inside = _is_inside(volumes, box, points)
            surely, possibly = (_is_behind(boxes, box, points, light, margin) for margin in (-1e-5, 1e-5))
            assert inside[surely].all()
            assert not inside[~possibly].any()
            seen += surely.sum()
    assert seen > 5000


@pytest.mark.parametrize("exits_first", [False, True])
def test_the_leading_planes_are_those_turned_to_the_eye_or_all_others(exits_first):
    rng = np.random.default_rng(7)
    boxes = _random_boxes(60, rng, largest=0.3)
    volumes, receivers, _ = _outlined(boxes, SUN, exits_first=exits_first)
    eye = np.array(receivers.eye)
    outside = 0
    for box in range(60):
        leading, count = volumes.plane_counts.numpy()[box]
        planes = volumes.planes.numpy()[box, :count]
        is_front = planes[:, :3] @ eye + planes[:, 3] > 1e-4
        if is_front.any():
            outside += 1
            np.testing.assert_array_equal(is_front, (np.arange(count) < leading) != exits_first)
    assert outside > 50


def test_with_the_eye_inside_all_planes_lead_and_the_whole_picture_is_covered():
    boxes = OrientedBoxes(np.full((1, 3), 0.5), np.eye(3)[None], np.eye(3)[None], np.array([[0.0, 2.0, 0.0]]))
    sun = np.array(SUN[:3])
    for behind in (0.0, 0.7, 1.4):
        eye = tuple(np.array((0.1, 2.0, 0.1)) - behind * sun)
        volumes, receivers, _ = _outlined(boxes, SUN, Camera(eye, (1.0, 0.0, 3.0)))
        leading, count = volumes.plane_counts.numpy()[0]
        assert leading == count > 0
        assert volumes.rows.numpy()[0].tolist() == [0, receivers.height]
        assert volumes.line_counts.numpy()[0] == 0


def test_a_light_within_the_box_leaves_nothing_out():
    boxes = OrientedBoxes(np.full((1, 3), 0.5), np.eye(3)[None], np.eye(3)[None], np.array([[0.9, 2.4, 0.7]]))
    volumes, receivers, _ = _outlined(boxes, LAMP)
    assert volumes.plane_counts.numpy()[0].tolist() == [0, 0]
    assert volumes.rows.numpy()[0].tolist() == [0, receivers.height]


def test_receivers_on_a_lit_face_are_no_candidates_and_those_a_little_behind_it_are():
    boxes = OrientedBoxes(np.array([[2.0, 0.0, 2.0]]), np.eye(3)[None], np.eye(3)[None], np.zeros((1, 3)))
    ulp = 2.0**-23 * WORLD.scale
    # at a cosine of 0.89 nothing within 14 ulp less the rounding can be shadowed
    points = np.array([(0.1, depth * ulp, 0.2) for depth in (1.0, 0.0, -1.0, -10.0, -15.0, -1e4)])
    for light in (SUN, (0.0, 40.0, 0.0, 1.0)):
        volumes, _, _ = _outlined(boxes, light)
        assert _is_inside(volumes, 0, points).tolist() == [False, False, False, False, True, True]


def _hull(points):
    """Corners of the convex hull of points in the picture, in order (Andrew's chain)."""
    ordered = sorted({tuple(p) for p in points.round(9)})

    def chain(sequence):
        kept = []
        for p in sequence:
            while len(kept) > 1:
                (ax, ay), (bx, by) = np.subtract(kept[-1], kept[-2]), np.subtract(p, kept[-2])
                if ax * by > ay * bx:
                    break
                kept.pop()
            kept.append(p)
        return kept[:-1]

    return np.array(chain(ordered) + chain(ordered[::-1]))


def _distances(hull, pixels):
    """Distance of each pixel from a hull, and by how much it is at most outside of one of its edges' lines."""
    edge = np.roll(hull, -1, axis=0) - hull
    length = np.linalg.norm(edge, axis=1)
    offset = pixels[:, None, :] - hull[None]
    outside = (offset[..., 0] * edge[:, 1] - offset[..., 1] * edge[:, 0]) / length
    along = ((offset * edge).sum(axis=2) / length**2).clip(0.0, 1.0)
    from_edge = np.linalg.norm(offset - along[..., None] * edge, axis=2).min(axis=1)
    return np.where(outside.max(axis=1) <= 0.0, 0.0, from_edge), outside.max(axis=1)


def _drawn(volumes, box, width, height):
    """Which pixels an outline covers."""
    rows, lines = volumes.rows.numpy()[box], volumes.lines.numpy()[box, : volumes.line_counts.numpy()[box]]
    row, column = np.mgrid[0:height, 0:width]
    covered = (lines[:, 0, None, None] * column + lines[:, 1, None, None] * row + lines[:, 2, None, None] >= 0).all(
        axis=0
    )
    return covered & (row >= rows[0]) & (row < rows[1])


@pytest.mark.parametrize("light", [SUN, LAMP], ids=["sun", "lamp"])
def test_an_outline_is_the_hull_of_the_box_and_of_its_image_beyond_the_world(light):
    rng = np.random.default_rng(11)
    width, height = 80, 60
    boxes = _random_boxes(80, rng, largest=0.4)
    camera = Camera((0.3, 2.0, 14.0), (0.0, 0.5, 0.0), vertical_angle=50.0)
    volumes, _, frame = _outlined(boxes, light, camera, (width, height))
    row, column = np.mgrid[0:height, 0:width]
    pixels = np.stack([column.ravel() + 0.5, row.ravel() + 0.5], axis=1)
    signs = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    compared = 0
    for box in range(80):
        near = boxes.centre[box] + (signs * boxes.half[box]) @ boxes.world_from_box[box].T
        away = light[3] * near - np.array(light[:3])
        far = near + volumes._boxes.reach.numpy()[box] * away
        corners = np.concatenate([near, far])
        u, v, _, w = frame.project(corners).T
        if (w < 0.1).any():
            continue
        compared += 1
        distance, outside = _distances(_hull(np.stack([u * width, v * height], axis=1)), pixels)
        drawn = _drawn(volumes, box, width, height).ravel()
        assert drawn[distance <= 0.5].all()
        # each line is moved out by half a pixel along rows and half a pixel along columns
        assert not drawn[outside > 0.75].any()
    assert compared > 40


def test_the_image_is_out_of_the_world_and_no_farther_than_it_must_be():
    low, high = (bound.astype(np.float64) for bound in WORLD.bounds())
    rng = np.random.default_rng(12)
    for _ in range(20):
        boxes, light = _random_boxes(10, rng, largest=0.4), _random_light(rng)
        reach = BoundingVolumes(boxes, light, WORLD, Context())._boxes.reach.numpy()
        for box in np.flatnonzero(np.isfinite(reach)):
            inner = rng.uniform(-1.0, 1.0, (200, 3)) * boxes.half[box]
            near = boxes.centre[box] + inner @ boxes.world_from_box[box].T
            far = near + reach[box] * (light[3] * near - np.array(light[:3]))
            is_out = ((far <= low) | (far >= high)).any(axis=1)
            length = np.linalg.norm(far - near, axis=1)
            assert (is_out | (length >= np.linalg.norm(high - low))).all()


def test_receivers_that_another_camera_saw_get_outlines_that_cover_everything():
    boxes = _random_boxes(3, np.random.default_rng(5), largest=0.2)
    camera = Camera((0.3, 3.0, 6.0), (0.0, 0.5, 0.0))
    frame = camera_frame(camera, 40, 30, WORLD)
    turned = Camera((0.3, 3.0, 6.0), (1.0, 0.5, 0.0))
    for receivers in (render(WORLD, turned, 40, 30, Context()), flat_receivers(40, 30)):
        volumes = BoundingVolumes(boxes, SUN, WORLD, Context())
        volumes.outline(receivers, frame, exits_first=False)
        assert (volumes.rows.numpy() == (0, 30)).all()
        assert (volumes.line_counts.numpy() == 0).all()


def test_outlines_do_not_depend_on_the_number_of_threads():
    boxes = _random_boxes(500, np.random.default_rng(6))
    camera = Camera((0.3, 3.0, 6.0), (0.0, 0.5, 0.0))
    receivers, frame = render(WORLD, camera, 40, 30, Context()), camera_frame(camera, 40, 30, WORLD)
    results = []
    for threads in (1, 3):
        volumes = BoundingVolumes(boxes, LAMP, WORLD, Context(threads=threads))
        volumes.outline(receivers, frame, exits_first=False)
        counts = volumes.line_counts.numpy()
        lines = [volumes.lines.numpy()[box, :count] for box, count in enumerate(counts)]
        results.append((np.concatenate(lines), volumes.rows.numpy(), volumes.plane_counts.numpy()))
    for one, more in zip(*results, strict=True):
        np.testing.assert_array_equal(one, more)
