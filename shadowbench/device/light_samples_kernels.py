"""Kernels that place points in a light's windows and transform them, for :mod:`shadowbench.device.light_samples`."""

import warp as wp

from shadowbench.device.launch import kernel_options
from shadowbench.device.placed_triangles import PlacedTriangles, corners_of
from shadowbench.device.sample_space import FARTHEST, SampleSpace, sample_of
from shadowbench.device.visibility import LightPoint, is_turned_away, towards_light

wp.set_module_options(kernel_options(native=True))

BLOCK = wp.constant(1 << 16)
"""Points a kernel handles in a row. Fixed, so that the order of the records never depends on the threads."""

DECIDED = wp.constant(255)
"""Stands for the window of a point that the light does not reach: it needs no triangle."""

AT_LIGHT = wp.constant(254)
"""Stands for the window of a point in a positional light's very place, which nothing can shadow."""

CERTAIN_COSINE = wp.constant(wp.float32(1.0e-5))
"""Beyond this, a receiver's float32 normal, which is turned towards the eye, and its position tell for certain on which
side of its plane something lies: that saves the triangle's vertices."""


@wp.func
def cube_face(offset: wp.vec3d):
    """Face of the largest component, of equal ones the first: +x, -x, +y, -y, +z, -z."""
    axis = wp.int32(0)
    if wp.abs(offset[1]) > wp.abs(offset[0]):
        axis = 1
    if wp.abs(offset[2]) > wp.abs(offset[axis]):
        axis = 2
    face = 2 * axis
    if offset[axis] < wp.float64(0.0):
        face += 1
    return face


@wp.struct
class Field:
    """What a light reaches: everything, or a spot light's cone.

    Attributes:
        window_count: 1, or 6 around a point light.
        axis: Unit axis of the cone.
        squared_cosine: Of half the opening angle; negative where there is no cone.
    """

    window_count: wp.int32
    axis: wp.vec3d
    squared_cosine: wp.float64


@wp.func
def is_in_field(field: Field, offset: wp.vec3d):
    """:func:`shadowbench.light_space.is_in_field_of_view` of a point at ``offset`` from the light, to the bit."""
    if field.squared_cosine < wp.float64(0.0):
        return True
    along = field.axis[0] * offset[0] + field.axis[1] * offset[1] + field.axis[2] * offset[2]
    squared = offset[0] * offset[0] + offset[1] * offset[1] + offset[2] * offset[2]
    return along > wp.float64(0.0) and along * along >= field.squared_cosine * squared


@wp.func
def window_of(light: LightPoint, field: Field, p: wp.vec3):
    """The window of a point under a spot or point light, or what stands for it."""
    offset = -towards_light(light, wp.vec3d(p))
    window = wp.int32(0)
    if wp.dot(offset, offset) == wp.float64(0.0):
        window = AT_LIGHT
    elif field.window_count > 1:
        window = cube_face(offset)
    if not is_in_field(field, offset):
        window = DECIDED
    return window


@wp.func
def certain_height(offset: wp.vec3, tolerance: wp.float32):
    """Beyond this height float32 tells for certain on which side of a receiver's plane something at an offset lies."""
    return CERTAIN_COSINE * (wp.abs(offset[0]) + wp.abs(offset[1]) + wp.abs(offset[2])) + tolerance


@wp.func
def turns_away(
    light: LightPoint,
    eye: wp.vec3d,
    placed: PlacedTriangles,
    triangle: wp.int32,
):
    """Whether a triangle is turned away from a light as the eye sees it, in float64."""
    a, b, c = corners_of(placed, triangle)
    return is_turned_away(a, b, c, eye, light)


UNSURE = wp.constant(253)
"""Stands, for a while, for the window of a receiver whose float32 normal does not tell whether it is turned away."""

Sides = wp.types.vector(length=8, dtype=wp.float32)


@wp.func_native("""
    typedef float lanes __attribute__((ext_vector_type(4)));
    const float* p = (const float*)position.data; const float* n = (const float*)normal.data;
    lanes low = farthest, high = -farthest;
    int sure_count = 0, unsure_count = 0;
    for (int i = begin; i < end; ++i) {
        const float height = n[3 * i] * towards[0] + n[3 * i + 1] * towards[1] + n[3 * i + 2] * towards[2];
        const bool away = valid.data[i] == 0 || height < -certain, doubtful = !away && height <= certain;
        window.data[i] = (unsigned char)(away ? decided : doubtful ? unsure : 0);
        sure_count += !away && !doubtful;
        unsure_count += doubtful;
        if (!away) {
            const lanes here = {p[3 * i], p[3 * i + 1], p[3 * i + 2], 0.0f};
            low = __builtin_elementwise_min(low, here);
            high = __builtin_elementwise_max(high, here);
        }
    }
    wp::vec_t<8, float> sides;
    for (int k = 0; k < 3; ++k) { sides[k] = low[k]; sides[3 + k] = high[k]; }
    sides[6] = (float)sure_count;
    sides[7] = (float)unsure_count;
    return sides;
""")
def _sides_in_sun(
    position: wp.array[wp.vec3],
    normal: wp.array[wp.vec3],
    valid: wp.array[wp.uint8],
    begin: wp.int32,
    end: wp.int32,
    towards: wp.vec3,
    certain: wp.float32,
    decided: wp.int32,
    unsure: wp.int32,
    farthest: wp.float32,
    window: wp.array[wp.uint8],
) -> Sides: ...


@wp.func
def sides_in_sun(
    position: wp.array[wp.vec3],
    normal: wp.array[wp.vec3],
    valid: wp.array[wp.uint8],
    begin: wp.int32,
    end: wp.int32,
    towards: wp.vec3,
    certain: wp.float32,
    window: wp.array[wp.uint8],
):
    """Find on which side of their planes receivers have a directional light, as far as their normals tell.

    Returns:
        Bounds of the positions of those that are not surely turned away (low, high), then how many are surely not,
        and how many are :data:`UNSURE`.
    """
    return _sides_in_sun(position, normal, valid, begin, end, towards, certain, DECIDED, UNSURE, FARTHEST, window)


@wp.func
def sides_in_sun_plainly(
    position: wp.array[wp.vec3],
    normal: wp.array[wp.vec3],
    valid: wp.array[wp.uint8],
    begin: wp.int32,
    end: wp.int32,
    towards: wp.vec3,
    certain: wp.float32,
    window: wp.array[wp.uint8],
):
    """The meaning of :func:`sides_in_sun`."""
    low = wp.vec3(FARTHEST, FARTHEST, FARTHEST)
    high = -low
    sure = wp.int32(0)
    unsure = wp.int32(0)
    for i in range(begin, end):
        height = wp.dot(normal[i], towards)
        w = wp.int32(0)
        if valid[i] == wp.uint8(0) or height < -certain:
            w = DECIDED
        elif height <= certain:
            w = UNSURE
            unsure += 1
        else:
            sure += 1
        window[i] = wp.uint8(w)
        if w != DECIDED:
            low = wp.min(low, position[i])
            high = wp.max(high, position[i])
    return Sides(low[0], low[1], low[2], high[0], high[1], high[2], wp.float32(sure), wp.float32(unsure))


@wp.kernel
def place_receivers_in_sun(
    first: wp.int32,
    # inputs
    light: LightPoint,
    eye: wp.vec3d,
    tolerance: wp.float64,
    placed: PlacedTriangles,
    valid: wp.array[wp.uint8],
    position: wp.array[wp.vec3],
    normal: wp.array[wp.vec3],
    triangle: wp.array[wp.int32],
    # outputs
    window: wp.array[wp.uint8],
    sample_count: wp.array2d[wp.int32],
    low: wp.array[wp.vec3],
    high: wp.array[wp.vec3],
):
    """Find every receiver that is valid and not turned away from a directional light."""
    block = wp.tid() + first
    begin = block * BLOCK
    end = wp.min(begin + BLOCK, position.shape[0])
    towards = wp.vec3(wp.float32(light.point[0]), wp.float32(light.point[1]), wp.float32(light.point[2]))
    certain = certain_height(towards, wp.float32(tolerance))
    sides = sides_in_sun(position, normal, valid, begin, end, towards, certain, window)
    count = wp.int32(sides[6])
    if sides[7] > 0.0:
        for i in range(begin, end):
            if wp.int32(window[i]) == UNSURE:
                window[i] = wp.uint8(DECIDED)
                if not turns_away(light, eye, placed, triangle[i]):
                    window[i] = wp.uint8(0)
                    count += 1
    sample_count[block, 0] = count
    low[block] = wp.vec3(sides[0], sides[1], sides[2])
    high[block] = wp.vec3(sides[3], sides[4], sides[5])


@wp.kernel
def place_receivers(
    first: wp.int32,
    # inputs
    light: LightPoint,
    field: Field,
    eye: wp.vec3d,
    tolerance: wp.float64,
    placed: PlacedTriangles,
    valid: wp.array[wp.uint8],
    position: wp.array[wp.vec3],
    normal: wp.array[wp.vec3],
    triangle: wp.array[wp.int32],
    # outputs
    window: wp.array[wp.uint8],
    sample_count: wp.array2d[wp.int32],
    low: wp.array[wp.vec3],
    high: wp.array[wp.vec3],
    visibility: wp.array2d[wp.float32],
):
    """Find the window of every receiver that is valid, in a positional light's field and not turned away from it."""
    block = wp.tid() + first
    point = wp.vec3(wp.float32(light.point[0]), wp.float32(light.point[1]), wp.float32(light.point[2]))
    least = wp.vec3(FARTHEST, FARTHEST, FARTHEST)
    most = -least
    for i in range(block * BLOCK, wp.min((block + 1) * BLOCK, position.shape[0])):
        p = position[i]
        w = wp.int32(DECIDED)
        if valid[i] != wp.uint8(0):
            w = window_of(light, field, p)
        if w != DECIDED:
            offset = point - p
            certain = certain_height(offset, wp.float32(tolerance))
            height = wp.dot(normal[i], offset)
            away = height < 0.0
            if wp.abs(height) <= certain:
                away = turns_away(light, eye, placed, triangle[i])
            if away:
                w = DECIDED
        window[i] = wp.uint8(w)
        if w < AT_LIGHT:
            sample_count[block, w] = sample_count[block, w] + 1
            least = wp.min(least, p)
            most = wp.max(most, p)
        if w == AT_LIGHT:
            for k in range(visibility.shape[1]):
                visibility[i, k] = 1.0
    low[block] = least
    high[block] = most


@wp.kernel
def place_points(
    first: wp.int32,
    # inputs
    light: LightPoint,
    field: Field,
    position: wp.array[wp.vec3],
    # outputs
    window: wp.array[wp.uint8],
    sample_count: wp.array2d[wp.int32],
    low: wp.array[wp.vec3],
    high: wp.array[wp.vec3],
    visibility: wp.array2d[wp.float32],
):
    """Find the window of every point in the light's field."""
    block = wp.tid() + first
    least = wp.vec3(FARTHEST, FARTHEST, FARTHEST)
    most = -least
    for i in range(block * BLOCK, wp.min((block + 1) * BLOCK, position.shape[0])):
        p = position[i]
        w = wp.int32(0)
        if light.point[3] != wp.float64(0.0):
            w = window_of(light, field, p)
        window[i] = wp.uint8(w)
        if w < AT_LIGHT:
            sample_count[block, w] = sample_count[block, w] + 1
            least = wp.min(least, p)
            most = wp.max(most, p)
        if w == AT_LIGHT:
            for k in range(visibility.shape[1]):
                visibility[i, k] = 1.0
    low[block] = least
    high[block] = most


@wp.func_native("""
    const float* p = (const float*)position.data; wp::vec4* out = records.data;
    for (int i = begin; i < end; ++i) {
        if (window.data[i] != 0) continue;
        const float x = p[3 * i] - space.centre[0], y = p[3 * i + 1] - space.centre[1];
        const float z = p[3 * i + 2] - space.centre[2];
        for (int row = 0; row < 3; ++row) {
            const wp::vec_t<3, float> axis = space.axes.get_row(row);
            out[k][row] = axis[0] * x + axis[1] * y + axis[2] * z;
        }
        __builtin_memcpy((char*)(out + k++) + 12, &i, 4);
    }
""")
def lay_down_in_sun(
    space: SampleSpace,
    window: wp.array[wp.uint8],
    position: wp.array[wp.vec3],
    begin: wp.int32,
    end: wp.int32,
    k: wp.int32,
    records: wp.array[wp.vec4],
):
    """Lay down the samples of an orthographic window, from record k on."""


@wp.func
def lay_down_plainly(
    space: SampleSpace,
    number: wp.int32,
    window: wp.array[wp.uint8],
    position: wp.array[wp.vec3],
    begin: wp.int32,
    end: wp.int32,
    k: wp.int32,
    records: wp.array[wp.vec4],
):
    """Lay down the samples of any window, from record k on."""
    for i in range(begin, end):
        if wp.int32(window[i]) == number:
            s = sample_of(space, position[i])
            records[k] = wp.vec4(s[0], s[1], s[2], wp.cast(i, wp.float32))
            k += 1


@wp.kernel
def transform_samples(
    first: wp.int32,
    # inputs
    space: SampleSpace,
    number: wp.int32,
    window: wp.array[wp.uint8],
    position: wp.array[wp.vec3],
    first_record: wp.array[wp.int32],
    # outputs
    records: wp.array[wp.vec4],
):
    """Lay down (x, y, depth, number of the point) of each sample of a window."""
    block = wp.tid() + first
    k = first_record[block]
    begin = block * BLOCK
    end = wp.min(begin + BLOCK, position.shape[0])
    if first_record[block + 1] > k:
        if space.is_perspective == wp.float64(0.0):
            lay_down_in_sun(space, window, position, begin, end, k, records)
        else:
            lay_down_plainly(space, number, window, position, begin, end, k, records)
