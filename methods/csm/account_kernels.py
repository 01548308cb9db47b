"""The Fourier series of one receiver, by the functions that look up: for its account only."""

import warp as wp

from shadowbench.device.filtered_lookup import (
    Corners,
    PixelPoints,
    Sampling,
    find_footprint,
    find_pixel,
    mean_over_footprint,
)
from shadowbench.device.fourier_sums import interpolated_sum
from shadowbench.device.launch import kernel_options
from shadowbench.device.mip_chains_kernels import ChainLayout
from shadowbench.device.shadow_lookup import LightMaps
from shadowbench.methods.csm.kernels import Receiver, receiver_at

wp.set_module_options(kernel_options(native=True))


def account_kernel(element):
    """Make the kernel that tells a receiver's series, for basis images of the given type."""

    @wp.func
    def sum_at(values: wp.array[element], corners: Corners, receiver: Receiver):
        return interpolated_sum(values, corners, receiver.weights, receiver.count)

    mean_sum = mean_over_footprint(sum_at)

    @wp.kernel
    def tell_series(
        first: wp.int32,
        # inputs
        maps: LightMaps,
        points: PixelPoints,
        bias: wp.float64,
        values: wp.array[element],
        layout: ChainLayout,
        sampling: Sampling,
        scales: wp.array[wp.float32],
        unit: wp.float32,
        zero: wp.float32,
        # outputs
        told: wp.array[wp.float32],
    ):
        """Write depth, constant, series, visibility, and the weights of the channels."""
        i = wp.tid() + first
        found = find_pixel(maps, points, i)
        footprint = find_footprint(maps, found, points, i, layout, sampling)
        depth = wp.float32(wp.max(found.depth - bias, wp.float64(0.0)))
        receiver = receiver_at(depth, scales, unit, zero)
        series = receiver.constant + mean_sum(values, layout, found.face, footprint, receiver)
        told[0] = depth
        told[1] = receiver.constant
        told[2] = series
        told[3] = wp.clamp(series, wp.float32(0.0), wp.float32(1.0))
        for k in range(receiver.count):
            told[4 + k] = receiver.weights[k]

    return tell_series


tell_floats = account_kernel(wp.float32)
tell_bytes = account_kernel(wp.uint8)
