"""OpenGL's shadow map against our own rasteriser and look-up, in the same frames."""

from dataclasses import replace

import numpy as np
import pytest
from map_filters import four_places
from opengl_peer import maps_of, needs_opengl, opengl
from surfaces import corners_of, receivers_at, scattered_receivers, soup, world_of
from tracing import shaded

from shadowbench.device.launch import Context
from shadowbench.light_space import is_in_field_of_view, light_frames
from shadowbench.methods.pcf import PercentageCloserFiltering
from shadowbench.methods.shadow_map import ShadowMap
from shadowbench.scene import DirectionalLight, PointLight, SpotLight

pytestmark = needs_opengl

LIGHTS = {
    "sun": DirectionalLight((0.4, 1.0, 0.3)),
    "spot": SpotLight((1.5, 4.0, 1.0), (-1.5, -4.0, -1.0), 70.0),
    "lamp": PointLight((0.2, 0.9, 0.1)),
}
RESOLUTION = 256
WORLD = world_of(soup(1500, np.random.default_rng(1)), lights=LIGHTS)
RECEIVERS = scattered_receivers(WORLD, 20_000, np.random.default_rng(2))

WEIGHT_STEP = 1.0 / 256.0
"""Graphics hardware keeps eight bits of a place between two texels."""


def own(cls, light, **values):
    """Our own method's result and map."""
    visibility, trace = shaded(cls(cls.Parameters(**values), Context()), WORLD, WORLD.lights[light], RECEIVERS)
    return visibility, trace.kept["shadow map"].numpy()


def distances_to_edges(frame, column, row):
    """Distance of texel centres from the nearest edge of any triangle in front of the light [texels]."""
    corners = corners_of(WORLD)
    h = frame.project(corners.reshape(-1, 3)).reshape(-1, 3, 4)
    h = h[(h[:, :, 3] > (frame.near or 0.0)).all(axis=1)]
    a = h[:, :, :2] * RESOLUTION
    along = np.roll(a, -1, axis=1) - a
    found = []
    for x, y in zip(column, row, strict=True):
        offset = np.array((x + 0.5, y + 0.5)) - a
        t = np.clip((offset * along).sum(axis=2) / np.maximum((along**2).sum(axis=2), 1e-30), 0.0, 1.0)
        found.append(np.linalg.norm(offset - t[:, :, None] * along, axis=2).min())
    return np.array(found)


@pytest.mark.parametrize("light", LIGHTS)
def test_the_map_is_our_rasterisers_but_for_texels_on_a_triangles_edge(light):
    method = opengl("shadow-map", filter="nearest", resolution=RESOLUTION, slope_bias=0.0)
    shaded(method, WORLD, WORLD.lights[light], RECEIVERS)
    theirs = maps_of(method)
    _, ours = own(ShadowMap, light, resolution=RESOLUTION, slope_bias=0.0)
    assert 0.2 < (ours < 1.0).mean() < 0.8
    # a depth buffer of 24 bits, and float32 where ours is float64
    faces, rows, columns = np.nonzero(np.abs(theirs - ours) > 2e-6)
    assert len(faces) <= theirs.size / 1000
    frames = light_frames(WORLD.lights[light], WORLD)
    for face, frame in enumerate(frames):
        here = faces == face
        # vertices are snapped to a fraction of a texel, 1/16 at the coarsest that OpenGL allows
        assert (distances_to_edges(frame, columns[here], rows[here]) < 1.0 / 16.0).all()


@pytest.mark.parametrize("light", ["sun", "spot"])
def test_polygon_offset_is_the_larger_slope(light):
    raised, flat = (
        opengl("shadow-map", filter="nearest", resolution=RESOLUTION, slope_bias=factor) for factor in (1.0, 0.0)
    )
    for method in (raised, flat):
        shaded(method, WORLD, WORLD.lights[light], RECEIVERS)
    theirs, before = maps_of(raised), maps_of(flat)
    _, ours = own(ShadowMap, light, resolution=RESOLUTION, slope_bias=1.0)
    agree = np.abs(theirs - ours) <= (1e-6 if light == "sun" else 1e-4)  # differences between neighbours are no slope
    assert agree.mean() > 0.98
    assert (theirs - before)[theirs < 1.0].mean() > 1e-3


@pytest.mark.parametrize("light", LIGHTS)
@pytest.mark.parametrize(
    ("filter_", "cls", "values"), [("nearest", ShadowMap, {}), ("bilinear", PercentageCloserFiltering, "bilinear")]
)
def test_it_shadows_as_our_own_does_but_for_one_receiver_in_five_hundred(light, filter_, cls, values):
    method = opengl("shadow-map", filter=filter_, resolution=RESOLUTION)
    theirs, _ = shaded(method, WORLD, WORLD.lights[light], RECEIVERS)
    ours, _ = own(cls, light, resolution=RESOLUTION, **({"filter": values} if values else {}))
    reached = is_in_field_of_view(WORLD.lights[light], RECEIVERS.position)
    # those that look at a texel on an edge, lie on a texel's border, or as deep as what is stored
    differing = np.abs(theirs - ours)[reached] > WEIGHT_STEP
    assert differing.sum() <= reached.sum() / 500
    assert 0.1 < theirs[reached].mean() < 0.9


@pytest.mark.parametrize("light", LIGHTS)
def test_the_comparing_sampler_weighs_four_tests_of_the_map_it_has(light):
    method = opengl("shadow-map", resolution=RESOLUTION, bias=1e-4)
    theirs, _ = shaded(method, WORLD, WORLD.lights[light], RECEIVERS)
    depth = maps_of(method)
    frames = light_frames(WORLD.lights[light], WORLD)
    reached = is_in_field_of_view(WORLD.lights[light], RECEIVERS.position)
    offset = RECEIVERS.position - np.array(getattr(WORLD.lights[light], "position", (0.0, 0.0, 0.0)))
    axis = np.argmax(np.abs(offset), axis=1)
    face = 2 * axis + (np.take_along_axis(offset, axis[:, None], 1)[:, 0] < 0.0) if len(frames) == 6 else 0 * axis
    expected = np.zeros(RECEIVERS.count)
    for k, frame in enumerate(frames):
        here = face == k
        u, v, d, _ = frame.project(RECEIVERS.position[here]).T
        expected[here] = sum(share * (d - 1e-4 <= depth[k][texel]) for texel, share in four_places(RESOLUTION, u, v))
    assert (np.abs(theirs - expected)[reached] > WEIGHT_STEP).sum() <= 5


def test_receivers_come_back_in_their_order_whatever_the_pictures_shape():
    method = opengl("shadow-map", resolution=RESOLUTION)
    whole, _ = shaded(method, WORLD, WORLD.lights["sun"], RECEIVERS)
    method.close()
    for width in (1, 7, 1000, 100_000):
        again, _ = shaded(method, WORLD, WORLD.lights["sun"], replace(RECEIVERS, width=width))
        np.testing.assert_array_equal(again, whole)
    few = receivers_at(WORLD, np.array([3, 40, 41]), np.full((3, 3), 1.0 / 3.0))
    assert shaded(method, WORLD, WORLD.lights["sun"], few)[0].shape == (3,)


def test_nearer_than_the_near_plane_nothing_shadows():
    world = world_of(soup(300, np.random.default_rng(3)), lights={"lamp": PointLight((0.2, 0.9, 0.1), near=0.6)})
    receivers = scattered_receivers(world, 2000, np.random.default_rng(4))
    lit, _ = shaded(opengl("shadow-map", resolution=64), world, world.lights["lamp"], receivers)
    near = np.abs(receivers.position - np.array((0.2, 0.9, 0.1))).max(axis=1) < 0.6
    assert near.sum() > 20
    assert (lit[near] == 1.0).all()


def test_the_footprint_is_told_to_the_filtered_reference():
    kernel = opengl("shadow-map", resolution=64).kernel(RECEIVERS)
    assert (kernel.shape, kernel.width, kernel.resolution) == ("bilinear", 2.0, 64)
    assert opengl("shadow-map", filter="nearest").kernel(RECEIVERS) is None
