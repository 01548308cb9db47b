"""Williams' depth test."""

import warp as wp

from shadowbench.device.launch import kernel_options
from shadowbench.device.shadow_lookup import LightMaps, find_in_map, is_lit_at, texel_index

wp.set_module_options(kernel_options(native=True))


@wp.kernel
def compare_nearest_texel(
    first: wp.int32,
    # inputs
    maps: LightMaps,
    position: wp.array[wp.vec3],
    normal: wp.array[wp.vec3],
    bias: wp.float64,
    normal_offset: wp.float64,
    plane: wp.float64,
    # outputs
    visibility: wp.array[wp.float32],
):
    i = wp.tid() + first
    found = find_in_map(maps, position[i], normal[i], normal_offset, plane)
    if found.state >= 0:
        visibility[i] = wp.float32(found.state)
    else:
        visibility[i] = is_lit_at(maps, found, texel_index(found.x), texel_index(found.y), bias)
