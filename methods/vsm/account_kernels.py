"""Chebyshev's bound of one receiver, by the functions that look up: for its account only."""

import warp as wp

from shadowbench.device.filtered_lookup import PixelPoints, Sampling, find_footprint, find_pixel
from shadowbench.device.launch import kernel_options
from shadowbench.device.mip_chains_kernels import ChainLayout
from shadowbench.device.shadow_lookup import LightMaps
from shadowbench.methods.vsm.kernels import chebyshev_bound, mean_moments, reduce_bleeding

wp.set_module_options(kernel_options(native=True))


@wp.kernel
def tell_bound(
    first: wp.int32,
    # inputs
    maps: LightMaps,
    points: PixelPoints,
    bias: wp.float64,
    values: wp.array[wp.float32],
    layout: ChainLayout,
    sampling: Sampling,
    minimum_variance: wp.float32,
    bleeding_reduction: wp.float32,
    # outputs
    told: wp.array[wp.float32],
):
    """Write depth, both moments, the bound, and the bound with bleeding reduced."""
    i = wp.tid() + first
    found = find_pixel(maps, points, i)
    footprint = find_footprint(maps, found, points, i, layout, sampling)
    depth = wp.float32(found.depth - bias)
    moments = mean_moments(values, layout, found.face, footprint, depth)
    bound = chebyshev_bound(moments, depth, minimum_variance)
    told[0] = depth
    told[1] = moments[0]
    told[2] = moments[1]
    told[3] = bound
    told[4] = reduce_bleeding(bound, bleeding_reduction)
