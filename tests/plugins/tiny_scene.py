"""A box over a ground, small enough to be measured at once; and a method that is right about it by formula."""

import numpy as np
import warp as wp

from shadowbench.method import Method
from shadowbench.parameters import ParameterModel, parameter
from shadowbench.scene import Camera, DirectionalLight, Instance, Mesh, PointLight, Scene, ScenePlugin

HALF, LIFT = 0.5, 1.0


class Tiny(ScenePlugin):
    """A square floats over a ground; seen and lit from straight above, its shadow is a square."""

    name = "tiny"
    title = "A square over a ground"

    class Parameters(ParameterModel):
        ground: float = parameter(2.0, unit="scene units", help="Half the ground's side.", gt=0.5, le=8.0)

    def make(self, parameters):
        def square(half, height):
            corners = [(-half, height, -half), (-half, height, half), (half, height, half), (half, height, -half)]
            return np.array(corners, np.float32), np.array([[0, 1, 2], [0, 2, 3]], np.int32)

        return Scene(
            meshes=(Mesh("ground", *square(parameters.ground, 0.0)), Mesh("square", *square(HALF, LIFT))),
            instances=(Instance(0), Instance(1)),
            lights={"sun": DirectionalLight((0.5, 1.0, 0.0)), "lamp": PointLight((0.5, 3.0, 0.0))},
            cameras={
                "above": Camera((0.0, 6.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, -1.0)),
                "side": Camera((3, 3, 3), (0, 0, 0)),
            },
        )


class Formula(Method):
    """The shadow of the square under the sun, by formula."""

    name = "formula"
    title = "By formula"
    counters = {"receivers looked at": "all of them"}

    class Parameters(ParameterModel):
        shift: float = parameter(0.0, unit="scene units", help="How far the shadow is moved off.")

    def build(self, casters, light, view, changes, trace):
        with trace.stage("nothing"):
            pass
        trace.keep("shift", np.array([self.parameters.shift], np.float32))

    def shade(self, receivers, visibility, trace):
        with trace.stage("formula"):
            x, y, z = receivers.position.T
            x = x + 0.5 * (LIFT - y) - self.parameters.shift
            shadowed = (np.abs(x) < HALF) & (np.abs(z) < HALF) & (y < 0.5 * LIFT)
            wp.copy(visibility, wp.array(np.where(shadowed, 0.0, 1.0).astype(np.float32), device=self.context.device))
        trace.count("receivers looked at", receivers.count)
