"""A few solids one above another on a plane, where filters of a shadow map meet depths that do not belong together.

Annen et al. do not say what their Figure 5(b) shows. This holds what their failure cases need (section 3.2): a shadow's
edge that runs over a rim with the plane far below, so that a filter's footprint holds shadow, light, and depths beyond
the receiver's. Bars shade a slab and go on over its rim, a ball lies on that rim, a ring leans on a stack of boxes, a
needle's shadow climbs steps. 8,946 triangles; there is nothing to choose.
"""

from __future__ import annotations

import numpy as np
from pydantic import BaseModel

from shadowbench.scene import Camera, DirectionalLight, Light, PointLight, Scene, ScenePlugin, SpotLight, cosine_sine

from .setting import Setting
from .shapes import Shape, bars, boxes, cylinder, joined, rectangle, revolved, sphere
from .tubes import tubes

LIGHTS: dict[str, Light] = {
    "sun": DirectionalLight((-0.55, 1.0, 0.45)),
    "spot": SpotLight(position=(-3.0, 5.2, 2.6), direction=(3.0, -5.0, -2.6), angle=58.0),
    "lamp": PointLight((0.62, 1.2, 0.75)),
}

CAMERAS = {
    "overview": Camera(eye=(2.4, 2.9, 4.3), target=(-0.15, 0.36, -0.05), vertical_angle=37.0),
    "rim": Camera(eye=(0.5, 1.75, 1.9), target=(-0.45, 0.75, 0.1), vertical_angle=30.0),
    "top": Camera(eye=(-0.15, 6.0, 0.25), target=(-0.15, 0.0, 0.25), up=(0.0, 0.0, -1.0), vertical_angle=36.0),
}


class OccludersOnPlane(ScenePlugin):
    """See the module."""

    name = "occluders-on-plane"
    title = "Occluders over each other on a plane"
    source = "for Annen et al. 2008, Figure 5(b) and Table 2"

    def make(self, parameters: BaseModel) -> Scene:
        """Put the solids up."""
        setting = Setting()
        setting.add("plane", rectangle((-3.0, 3.0), (-3.0, 3.0)), (0.76, 0.76, 0.74))
        setting.add("slab", _slab(), (0.82, 0.72, 0.56))
        setting.add("grating", _grating(), (0.42, 0.50, 0.56))
        setting.add("ball", sphere(0.26, 64, 32), (0.78, 0.36, 0.28), (0.12, SLAB_TOP + 0.26, 0.36, 0.0))
        x, z, turn = BOX_PLACE
        setting.add("box", boxes((-0.32, 0.0, -0.32), (0.32, 0.64, 0.32)), (0.46, 0.58, 0.40), (x, 0.0, z, turn))
        setting.add("upper box", boxes((-0.2, 0.0, -0.2), (0.2, 0.4, 0.2)), (0.60, 0.68, 0.46), (x, 0.64, z, -25.0))
        # the ring's hindmost point touches the box's front
        ring = _ring(0.27, 0.05)
        cosine, sine = cosine_sine(turn)
        away = 0.32 - float(ring.points[:, 2].min())
        place = (x + away * float(sine), 0.0, z + away * float(cosine), turn)
        setting.add("ring", ring, (0.84, 0.70, 0.30), place)
        setting.add("steps", _steps(), (0.66, 0.60, 0.70), (0.0, 0.0, 1.32, 0.0))
        setting.add("needle", _needle(), (0.36, 0.46, 0.66), (-0.24, 0.0, 1.56, 0.0))
        return setting.scene(LIGHTS, CAMERAS)


SLAB_TOP = 0.74

BOX_PLACE = (1.0, -0.45, 20.0)
"""x, z, and turn about the vertical [degrees]."""


def _slab() -> Shape:
    """Return a slab on four round legs."""
    legs = [cylinder(0.05, 0.0, SLAB_TOP - 0.06, 32).moved(x, 0.0, z) for x in (-1.22, 0.12) for z in (-0.62, 0.42)]
    return joined([boxes((-1.35, SLAB_TOP - 0.06, -0.75), (0.25, SLAB_TOP, 0.55)), *legs])


def _grating() -> Shape:
    """Return seven bars over the slab, which stand out beyond it on a frame with posts on the plane."""
    x = np.linspace(-1.5, -0.18, 7)
    ends = [np.stack([x, np.full(7, 1.35), np.full(7, z)], axis=1) for z in (-0.95, 0.95)]
    rails = [bars((-1.6, 1.31, z), (-0.08, 1.31, z), 0.05, 0.05) for z in (-0.9, 0.9)]
    posts = [
        boxes((px - 0.03, 0.0, pz - 0.03), (px + 0.03, 1.285, pz + 0.03)) for px in (-1.57, -0.11) for pz in (-0.9, 0.9)
    ]
    return joined([bars(ends[0], ends[1], 0.045, 0.045), *rails, *posts])


def _ring(radius: float, thickness: float) -> Shape:
    """Return a ring that stands on the plane and leans back by 28 degrees."""
    cosine, sine = cosine_sine(np.linspace(0.0, 360.0, 25))
    lying = revolved(np.stack([radius + thickness * cosine, thickness * sine], axis=1), 72)
    leaning = lying.turned((1.0, 0.0, 0.0), 62.0)
    return leaning.moved(y=-float(leaning.points[:, 1].min()))


def _steps() -> Shape:
    return joined(boxes((0.16 * k, 0.0, -0.3), (0.16 * (k + 1), 0.11 * (k + 1), 0.3)) for k in range(4))


def _needle() -> Shape:
    """Return a post that ends in a point, beside a wire hoop that stands on the plane."""
    post = revolved([(0.0, 0.0), (0.04, 0.0), (0.04, 0.75), (0.0, 0.95)], 32)
    cosine, sine = cosine_sine(np.linspace(0.0, 180.0, 33))
    hoop = np.stack([-0.42 + 0.26 * cosine, 0.26 * sine, np.full(33, 0.06)], axis=1)
    return joined([post, tubes(hoop[None], 0.012, 10)])
