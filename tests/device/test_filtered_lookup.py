"""Footprints against projected pixels, and look-ups into chains against NumPy's own interpolation."""

import numpy as np
import pytest
import warp as wp
from builders import LIGHTS, box_over_ground

from shadowbench.camera_pass import render
from shadowbench.device.filtered_lookup import (
    Corners,
    PixelPoints,
    Sampling,
    find_footprint,
    find_pixel,
    interpolate,
    maximum_over_footprint,
    mean_over_footprint,
    pixel_points,
    sampling_by,
)
from shadowbench.device.launch import Context, kernel_options, launch
from shadowbench.device.mip_chains import MipChain
from shadowbench.device.mip_chains_kernels import ChainLayout
from shadowbench.device.shadow_lookup import LightMaps, light_maps
from shadowbench.light_space import cube_face_of, light_frames

wp.set_module_options(kernel_options(native=True))

WORLD = box_over_ground()
RECEIVERS = render(WORLD, WORLD.cameras["front"], 48, 36, Context())
SIZES = [64, 37]


@wp.func
def value_at(values: wp.array[wp.float32], corners: Corners, scale: wp.float32):
    return scale * interpolate(
        corners,
        values[corners.top_left],
        values[corners.top_right],
        values[corners.bottom_left],
        values[corners.bottom_right],
    )


mean_value = mean_over_footprint(value_at)


@wp.kernel
def look_up(
    first: wp.int32,
    maps: LightMaps,
    points: PixelPoints,
    values: wp.array[wp.float32],
    maxima: wp.array[wp.float32],
    layout: ChainLayout,
    sampling: Sampling,
    mean: wp.array[wp.float32],
    most: wp.array[wp.float32],
    taps: wp.array[wp.int32],
    detail: wp.array[wp.float32],
    place: wp.array[wp.vec4d],
):
    i = wp.tid() + first
    found = find_pixel(maps, points, i)
    mean[i] = wp.float32(-1.0)
    if found.state < 0:
        footprint = find_footprint(maps, found, points, i, layout, sampling)
        mean[i] = mean_value(values, layout, found.face, footprint, wp.float32(1.0))
        most[i] = maximum_over_footprint(maxima, layout, found.face, footprint)
        taps[i] = footprint.taps
        detail[i] = wp.float32(footprint.level) + footprint.blend
        place[i] = wp.vec4d(footprint.x, footprint.y, footprint.step_x, footprint.step_y)


class _Looked:
    """What the kernel finds, and what it should: means over taps of trilinear look-ups, in float64."""

    def __init__(self, light_name, size, filtering, *, anisotropy=10, values=None, receivers=RECEIVERS):
        light = LIGHTS[light_name]
        self.frames, self.size = light_frames(light, WORLD), size
        faces = len(self.frames)
        has_levels = filtering in ("trilinear", "anisotropic")
        chains = [MipChain(faces, size, Context(), has_levels=has_levels) for _ in range(2)]
        if values is None:
            values = np.random.default_rng(1).random((faces, size, size, 1)).astype(np.float32)
        for chain in chains:
            chain.level(0).assign(values)
        if has_levels:
            chains[0].fill_with_means()
            chains[1].fill_with_maxima()
        self.levels = [chains[0].level(k).numpy()[..., 0].astype(np.float64) for k in range(chains[0].level_count)]
        depth = wp.zeros((faces, size, size), dtype=wp.float32, device="cpu")
        count = receivers.count
        outputs = [wp.zeros(count, dtype=t, device="cpu") for t in (wp.float32, wp.float32, wp.int32, wp.float32)]
        outputs.append(wp.zeros(count, dtype=wp.vec4d, device="cpu"))
        inputs = [light_maps(light, self.frames, depth), pixel_points(receivers.on("cpu"))]
        inputs += [chains[0].values, chains[1].values, chains[0].layout, sampling_by(filtering, anisotropy)]
        launch(look_up, count, inputs=inputs, outputs=outputs, context=Context())
        self.mean, self.most, self.taps, self.detail, self.place = (a.numpy() for a in outputs)
        self.seen = np.flatnonzero(self.mean >= 0.0)
        self.face = np.zeros(count, int)
        if faces == 6:
            self.face = cube_face_of(receivers.position.astype(np.float64) - np.array(light.position))
        self.receivers = receivers

    def texels(self, i, offset):
        """Window coordinates [texels] of a receiver moved by ``offset``."""
        point = self.receivers.position[i].astype(np.float64) + offset
        return self.frames[self.face[i]].project(point[None])[0, :2] * self.size

    def bilinear(self, face, level, x, y):
        values = self.levels[level][face]
        n = len(values)
        column, row = x * n / self.size - 0.5, y * n / self.size - 0.5
        i, j = int(np.floor(column)), int(np.floor(row))
        total = 0.0
        for b in (0, 1):
            for a in (0, 1):
                weight = (1.0 - abs(column - i - a)) * (1.0 - abs(row - j - b))
                total += weight * values[np.clip(j + b, 0, n - 1), np.clip(i + a, 0, n - 1)]
        return total

    def trilinear(self, i, x, y, detail):
        detail = np.clip(detail, 0.0, len(self.levels) - 1.0)
        level = int(detail)
        low = self.bilinear(self.face[i], level, x, y)
        high = self.bilinear(self.face[i], min(level + 1, len(self.levels) - 1), x, y)
        return low + (detail - level) * (high - low)

    def sides(self, i):
        """A pixel's two sides in the map [texels], by central differences."""
        step = 1e-3
        motions = (self.receivers.position_dx[i].astype(float), self.receivers.position_dy[i].astype(float))
        return [(self.texels(i, step * m) - self.texels(i, -step * m)) / (2.0 * step) for m in motions]


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("light", sorted(LIGHTS))
def test_nearest_takes_the_texel_that_holds_the_receiver(light, size):
    looked = _Looked(light, size, "nearest")
    differing = 0
    for i in looked.seen:
        column, row = np.clip(np.floor(looked.texels(i, 0.0)).astype(int), 0, size - 1)
        differing += looked.mean[i] != np.float32(looked.levels[0][looked.face[i], row, column])
    assert differing <= 1  # within rounding of a texel's border


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("light", sorted(LIGHTS))
def test_bilinear_interpolates_level_0_and_repeats_the_edges(light, size):
    looked = _Looked(light, size, "bilinear")
    expected = [looked.bilinear(looked.face[i], 0, *looked.texels(i, 0.0)) for i in looked.seen]
    np.testing.assert_allclose(looked.mean[looked.seen], expected, atol=2e-6)


@pytest.mark.parametrize("size", [512, 333])
@pytest.mark.parametrize("light", sorted(LIGHTS))
def test_trilinear_takes_its_level_from_the_longer_side_of_the_pixel(light, size):
    looked = _Looked(light, size, "trilinear")
    details = [np.log2(max(np.linalg.norm(s) for s in looked.sides(i))) for i in looked.seen]
    np.testing.assert_allclose(looked.detail[looked.seen], np.clip(details, 0.0, len(looked.levels) - 1), atol=1e-4)
    expected = [looked.trilinear(i, *looked.texels(i, 0.0), d) for i, d in zip(looked.seen, details, strict=True)]
    np.testing.assert_allclose(looked.mean[looked.seen], expected, atol=2e-4)
    assert np.ptp(details) > 2.0


@pytest.mark.parametrize("anisotropy", [2, 16])
@pytest.mark.parametrize("light", sorted(LIGHTS))
def test_anisotropic_spreads_taps_along_the_longer_side(light, anisotropy):
    looked = _Looked(light, 512, "anisotropic", anisotropy=anisotropy)
    expected, taps = [], []
    for i in looked.seen:
        shorter, longer = sorted(looked.sides(i), key=np.linalg.norm)
        ratio = np.linalg.norm(longer) / np.linalg.norm(shorter)
        count = min(int(np.ceil(ratio - 1e-6)), anisotropy)
        taps.append(count)
        middle = looked.texels(i, 0.0)
        detail = np.log2(np.linalg.norm(longer) / count)
        places = [middle + longer * ((k + 0.5) / count - 0.5) for k in range(count)]
        expected.append(np.mean([looked.trilinear(i, *place, detail) for place in places]))
    assert (np.array(taps) != looked.taps[looked.seen]).mean() < 0.01  # at whole ratios either is right
    np.testing.assert_allclose(looked.mean[looked.seen], expected, atol=2e-3)
    assert max(taps) == min(anisotropy, max(taps)) > 1


@pytest.mark.parametrize(
    ("filtering", "size"),
    [
        ("nearest", 37),
        ("bilinear", 64),
        ("trilinear", 512),
        ("trilinear", 333),
        ("anisotropic", 512),
        ("anisotropic", 37),
    ],
)
@pytest.mark.parametrize("light", sorted(LIGHTS))
def test_no_texel_of_a_footprint_exceeds_its_maximum(light, filtering, size):
    # a lone peak: where a mean feels it at all, the maximum must be the peak
    faces = len(light_frames(LIGHTS[light], WORLD))
    reached = 0
    for seed in range(12):
        values = np.zeros((faces, size, size, 1), np.float32)
        random = np.random.default_rng(seed)
        values[:, random.integers(0, size), random.integers(0, size)] = 1.0
        looked = _Looked(light, size, filtering, values=values)
        touched = looked.seen[looked.mean[looked.seen] > 0.0]
        assert (looked.most[touched] == 1.0).all()
        reached += len(touched)
    assert reached > 0


@pytest.mark.parametrize("filtering", ["nearest", "bilinear", "trilinear", "anisotropic"])
def test_a_constant_map_is_looked_up_as_that_constant_within_four_ulp(filtering):
    values = np.full((6, 37, 37, 1), 0.7, np.float32)
    looked = _Looked("lamp", 37, filtering, values=values)
    np.testing.assert_allclose(looked.mean[looked.seen], np.float32(0.7), rtol=4.0 * 2.0**-24)


@pytest.mark.parametrize("filtering", ["trilinear", "anisotropic"])
@pytest.mark.parametrize("motion", [0.0, 1e30, np.inf, np.nan])
def test_a_pixel_without_bounds_is_still_looked_up(filtering, motion):
    receivers = RECEIVERS
    changed = type(receivers)(
        **{
            **vars(receivers),
            "position_dx": np.full_like(receivers.position_dx, motion),
            "position_dy": np.full_like(receivers.position_dy, np.float32(0.5) * np.float32(motion)),
        }
    )
    looked = _Looked("lamp", 64, filtering, receivers=changed)
    assert len(looked.seen) > 0
    assert ((looked.mean[looked.seen] >= 0.0) & (looked.mean[looked.seen] <= 1.0)).all()
