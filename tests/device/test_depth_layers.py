"""Layers of fragments: the first is the depth rasteriser's, and all are what sorting every fragment gives."""

import numpy as np
import pytest
import warp as wp
from surfaces import soup, sphere

from shadowbench.device.depth_layers import LayeredRasterizer
from shadowbench.device.depth_rasterizer import DepthRasterizer, FragmentCounter
from shadowbench.device.launch import Context
from shadowbench.light_space import axes_of, orthographic_frame, perspective_frame

WIDTH, HEIGHT = 61, 47


def _perspective():
    axes = axes_of((0.1, -0.9, -1.0), (0.0, 1.0, 0.0))
    return perspective_frame((0.0, 1.6, 1.5), axes, (0.6, 0.5), 0.2, 6.0)  # the near plane cuts some


def _orthographic():
    forward = np.array([0.2, -1.0, 0.1])
    return orthographic_frame(forward, np.array([-1.2, -1.1, -1.5]), np.array([1.3, 1.2, 1.5]))


FRAMES = {"perspective": _perspective(), "orthographic": _orthographic()}


def _on_device(vertices, triangles):
    corners = wp.array(vertices, dtype=wp.vec3, device="cpu")
    return corners, wp.array(triangles.reshape(-1), dtype=wp.int32, device="cpu")


def _layers(frame, geometry, layers, threads=1):
    buffer = LayeredRasterizer(WIDTH, HEIGHT, layers, Context(threads=threads))
    buffer.draw(*_on_device(*geometry), frame.projection, near=frame.near)
    return buffer.ids.numpy(), buffer.depths.numpy()


def _one_by_one(frame, vertices, triangles):
    """Depth of every triangle alone, by the depth rasteriser: float32, shape [triangle_count, texel_count]."""
    alone = DepthRasterizer(WIDTH, HEIGHT, Context())
    depths = np.empty((len(triangles), WIDTH * HEIGHT), np.float32)
    for t, triangle in enumerate(triangles):
        alone.clear()
        alone.draw(*_on_device(vertices, triangle[None]), frame.projection, near=frame.near)
        depths[t] = alone.depth.numpy().reshape(-1)
    return depths


@pytest.mark.parametrize("frame", FRAMES.values(), ids=FRAMES)
@pytest.mark.parametrize("layers", [1, 3, 7])
def test_layers_are_all_fragments_sorted_by_depth(frame, layers):
    geometry = soup(60, np.random.default_rng(4), area=12.0)
    ids, depths = _layers(frame, geometry, layers)
    alone = _one_by_one(frame, *geometry)
    order = np.argsort(alone, axis=0, kind="stable")[:layers].T  # of equally near ones the first drawn leads
    expected = np.take_along_axis(alone.T, order, axis=1)
    np.testing.assert_array_equal(depths, expected)
    np.testing.assert_array_equal(ids, np.where(expected < 1.0, order, -1))
    assert (ids >= 0).sum(axis=1).max() >= min(layers, 5), "some texels are several deep"


@pytest.mark.parametrize("frame", FRAMES.values(), ids=FRAMES)
def test_the_first_layer_is_what_the_depth_rasterizer_keeps(frame):
    geometry = soup(3000, np.random.default_rng(5))
    ids, depths = _layers(frame, geometry, 2)
    nearest = DepthRasterizer(WIDTH, HEIGHT, Context(), keep_ids=True)
    nearest.draw(*_on_device(*geometry), frame.projection, near=frame.near)
    np.testing.assert_array_equal(ids[:, 0], nearest.ids.numpy().reshape(-1))
    np.testing.assert_array_equal(depths[:, 0], nearest.depth.numpy().reshape(-1))


def test_a_closed_surface_has_two_layers_wherever_it_has_one():
    geometry = sphere(3, np.array([0.0, 0.3, 0.0]), 0.6)
    ids, _ = _layers(FRAMES["orthographic"], geometry, 4)
    count = (ids >= 0).sum(axis=1)
    assert set(np.unique(count)) == {0, 2}
    counter = FragmentCounter(WIDTH, HEIGHT, Context())
    frame = FRAMES["orthographic"]
    counter.draw(*_on_device(*geometry), frame.projection, near=frame.near)
    np.testing.assert_array_equal(count, counter.counts.numpy().reshape(-1))


def test_of_sheets_in_one_plane_the_first_drawn_leads_and_none_is_lost():
    corners = np.array([(-1, 0, -1), (1, 0, -1), (0, 0, 1)], np.float32)
    geometry = np.tile(corners, (3, 1)), np.arange(9, dtype=np.int32).reshape(3, 3)
    ids, _ = _layers(FRAMES["orthographic"], geometry, 4)
    covered = ids[ids[:, 0] >= 0]
    assert len(covered) > 100
    assert (covered == [0, 1, 2, -1]).all()


@pytest.mark.parametrize("threads", [2, 5])
def test_every_thread_count_gives_the_same_bits(threads):
    geometry = soup(20_000, np.random.default_rng(6), area=20.0)
    for frame in FRAMES.values():
        one, more = _layers(frame, geometry, 4), _layers(frame, geometry, 4, threads)
        np.testing.assert_array_equal(one[0], more[0])
        np.testing.assert_array_equal(one[1], more[1])


def test_clearing_empties_the_lists():
    buffer = LayeredRasterizer(WIDTH, HEIGHT, 2, Context())
    frame = FRAMES["orthographic"]
    buffer.draw(*_on_device(*soup(50, np.random.default_rng(7))), frame.projection, near=frame.near)
    assert (buffer.ids.numpy() >= 0).any()
    buffer.clear()
    assert (buffer.ids.numpy() == -1).all()
    assert (buffer.depths.numpy() == 1.0).all()


def test_a_buffer_without_layers_is_refused():
    with pytest.raises(ValueError, match="at least 1 layer, not 0"):
        LayeredRasterizer(4, 4, 0, Context())
