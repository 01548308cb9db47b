"""Fourier series of the depth test, from means of sines and cosines."""

import warp as wp

from shadowbench.device.elementary_functions import sine_and_cosine
from shadowbench.device.filtered_lookup import (
    Corners,
    PixelPoints,
    Sampling,
    find_footprint,
    find_pixel,
    mean_over_footprint,
    texels_read,
)
from shadowbench.device.fourier_sums import Coefficients, interpolated_sum
from shadowbench.device.launch import kernel_options
from shadowbench.device.mip_chains_kernels import ChainLayout
from shadowbench.device.shadow_lookup import LightMaps

wp.set_module_options(kernel_options(native=True))


@wp.struct
class Receiver:
    """A receiver's side of the series: its test is ``constant`` plus the weighted sum of a mean texel's channels.

    Attributes:
        weights: Of the sines, then of the cosines.
        count: Of weights, 2 M.
        constant: The rest.
    """

    weights: Coefficients
    count: wp.int32
    constant: wp.float32


@wp.func
def receiver_at(depth: wp.float32, scales: wp.array[wp.float32], unit: wp.float32, zero: wp.float32):
    """Prepare a receiver at d: the series' factors of its blockers' sines and cosines (equation 8).

    The angles c_k d = (2 k - 1) π d are reached by turning on by 2 π d. A stored value v stands for
    ``unit * v - zero``.
    """
    receiver = Receiver()
    terms = scales.shape[0]
    receiver.count = 2 * terms
    angle = sine_and_cosine(depth)
    turn = sine_and_cosine(depth + depth)
    total = wp.float32(0.0)
    for k in range(terms):
        of_sine = scales[k] * angle[1]
        of_cosine = -(scales[k] * angle[0])
        receiver.weights[k] = unit * of_sine
        receiver.weights[terms + k] = unit * of_cosine
        total += of_sine + of_cosine
        angle = wp.vec2(angle[0] * turn[1] + angle[1] * turn[0], angle[1] * turn[1] - angle[0] * turn[0])
    receiver.constant = wp.float32(0.5) - zero * total
    return receiver


def csm_kernel(element):
    """Make the look-up kernel for basis images of the given type."""

    @wp.func
    def sum_at(values: wp.array[element], corners: Corners, receiver: Receiver):
        return interpolated_sum(values, corners, receiver.weights, receiver.count)

    mean_sum = mean_over_footprint(sum_at)

    @wp.kernel
    def look_up_series(
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
        visibility: wp.array[wp.float32],
        texels: wp.array[wp.int32],
    ):
        i = wp.tid() + first
        found = find_pixel(maps, points, i)
        texels[i] = 0
        if found.state >= 0:
            visibility[i] = wp.float32(found.state)
        else:
            footprint = find_footprint(maps, found, points, i, layout, sampling)
            depth = wp.float32(wp.max(found.depth - bias, wp.float64(0.0)))
            receiver = receiver_at(depth, scales, unit, zero)
            series = receiver.constant + mean_sum(values, layout, found.face, footprint, receiver)
            visibility[i] = wp.clamp(series, wp.float32(0.0), wp.float32(1.0))
            texels[i] = wp.int32(points.valid[i]) * texels_read(footprint)

    return look_up_series


look_up_floats = csm_kernel(wp.float32)
look_up_bytes = csm_kernel(wp.uint8)
