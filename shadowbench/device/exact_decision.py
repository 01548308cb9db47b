"""A triangle against a run of samples, decided exactly.

The float32 filter (:mod:`shadowbench.device.sample_scan`) decides what it can; what it doubts goes to the one predicate
(:mod:`shadowbench.device.visibility`): for an opaque triangle the closed one, since any crossing shadows; for a
translucent one the one that counts a crossing of a shared edge once, since every crossing dims. Both irregular
rasterisers, and nothing else, shadow samples through here.
"""

import warp as wp

from shadowbench.device.blockers import Blocker
from shadowbench.device.launch import kernel_options
from shadowbench.device.sample_scan import SampleArrays, is_opaque, scan, shadow
from shadowbench.device.visibility import LightPoint, crossing, crossing_once, reach_to_light, towards_light

wp.set_module_options(kernel_options(native=True))


@wp.func
def is_shadowed_by(light: LightPoint, tolerance: wp.float64, point: wp.vec3, a: wp.vec3, b: wp.vec3, c: wp.vec3):
    """Whether the opaque triangle abc shadows a point: the exact predicate."""
    p = wp.vec3d(point)
    t = crossing(p, towards_light(light, p), reach_to_light(light, p), tolerance, a, b, c)
    return t > wp.float64(0.0)


@wp.func
def is_dimmed_by(light: LightPoint, tolerance: wp.float64, point: wp.vec3, a: wp.vec3, b: wp.vec3, c: wp.vec3):
    """Whether the translucent triangle abc dims a point: the exact predicate that counts."""
    p = wp.vec3d(point)
    t = crossing_once(p, towards_light(light, p), reach_to_light(light, p), tolerance, a, b, c)
    return t > wp.float64(0.0)


@wp.func
def shadow_run(
    samples: SampleArrays,
    position: wp.array[wp.vec3],
    light: LightPoint,
    tolerance: wp.float64,
    blocker: Blocker,
    a: wp.vec3,
    b: wp.vec3,
    c: wp.vec3,
    transmittance: wp.vec3,
    begin: wp.int32,
    end: wp.int32,
    doubtful: wp.array[wp.int32],
):
    """Let triangle abc shadow the samples ``begin .. end`` that it shadows.

    Returns:
        How many samples it was tested against (see :class:`shadowbench.device.sample_scan.Scan`), and how many of them
        went to the exact predicate.
    """
    tested = wp.int32(0)
    refined = wp.int32(0)
    i = begin
    while i < end:
        found = scan(samples, blocker, transmittance, i, end, doubtful)
        for k in range(found.doubtful_count):
            j = doubtful[k]
            point = position[samples.source[j]]
            is_hit = wp.bool(False)
            if is_opaque(transmittance):
                is_hit = is_shadowed_by(light, tolerance, point, a, b, c)
            else:
                is_hit = is_dimmed_by(light, tolerance, point, a, b, c)
            if is_hit:
                shadow(samples, j, transmittance)
        tested += found.tested_count
        refined += found.doubtful_count
        i = found.next
    return tested, refined
