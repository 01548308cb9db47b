"""The kernel of :mod:`umbra_methods.technique`."""

import warp as wp

wp.set_module_options({"enable_backward": False})


@wp.kernel
def look_up(first: int, position: wp.array(dtype=wp.vec3), height: float, visibility: wp.array(dtype=float)):
    i = wp.tid() + first
    lit = float(1.0)
    if position[i][1] < height:
        lit = 0.0
    visibility[i] = lit
