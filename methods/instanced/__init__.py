"""Instanced shadow maps (Buntin & Stamminger 2007): a map for each object, applied after the camera pass.

Every caster has a map of its own, fitted to its bounding box as the light sees it. Under a directional light a map is
drawn once a mesh and shared by all instances that differ by translation and scale; instances that are rotated use the
maps of fixed angles, ``step`` degrees apart:

* ``rotation=interpolated-depth`` interpolates the depths that the two neighbouring maps hold, and the receiver's in
  both, and compares once: hard shadows at every angle, right for what is round about the axis and plausible for trees.
  A texel is *empty* where no depth was drawn, or outside the map; if one of the two is, there is nothing to interpolate
  and the map of the nearer angle decides alone.
* ``interpolated-result`` compares with both maps and blends the answers, which shows as two faint shadows.
* ``nearest`` takes the nearer map; ``exact`` draws a map for every angle that occurs.

Angles are those that the scene states, and are taken for a step if within 1e-4 degrees of it. An instance may turn
about any axis; it shares maps with those that turn about the same. Under a spot or point light each instance sees the
light from elsewhere and has a map of its own, fitted like the others, whatever ``rotation`` says; under a point light
one for each of the light's faces that it reaches into.

Maps are applied one by one. A caster's *bounding shadow volume*, its box and what that hides from the light, is
rasterised over the picture; receivers within are its *candidates*, and only they are looked up. ``candidates`` says
which test comes first, against the volume's planes turned to the eye (``z-pass``: what a depth test decides) or those
turned away (``z-fail``); with the eye inside a volume there is no entry and z-fail is used. ``skip_other_test`` looks
up what passed the first. A receiver is in front of the fragment of a convex body's face if and only if it is in front
of the plane of some face turned that way, so that tests against planes give what a depth buffer would.
``application=all-maps`` is the way before (Rege 2004): every receiver queries every caster's map.

Casters that are translucent dim: each multiplies the light by its transmittance, once, however many of its own surfaces
are in the way (a depth map knows the first only).

``sizing=importance`` gives each map as many texels as its largest instance has pixels, so that building belongs to
every frame. Otherwise maps are kept until the light, their mesh, or a rotation that they stand for changes.

Limits: aliasing as in any shadow map, but of texels that follow the object; rotations between steps are wrong on the
object itself. Cost: building, a mesh's triangles times its maps; shading, the pixels that volumes cover, whatever their
triangles. Kept are the maps; not counted are a kilobyte a caster of transforms and planes, and four bytes a receiver
for counting the overdraw.
"""

from __future__ import annotations

import math
from typing import Any, ClassVar, Literal

import numpy as np
import warp as wp
from numpy.typing import NDArray
from pydantic import field_validator

from shadowbench.account import Account
from shadowbench.depth_map_method import DepthMapParameters
from shadowbench.device.arrays import as_warp
from shadowbench.device.bounding_volumes import BoundingVolumes, OrientedBoxes
from shadowbench.device.launch import launch
from shadowbench.errors import ParameterError
from shadowbench.method import Changes, Method, Trace, View
from shadowbench.methods.instanced import angles, kernels
from shadowbench.methods.instanced.maps import CasterMapDrawer, CasterMeshes, MapKey, MapRequest
from shadowbench.methods.instanced.pairs import Pairs, pair_up
from shadowbench.methods.instanced.windows import corners_of, turned
from shadowbench.parameters import parameter
from shadowbench.receivers import Receivers
from shadowbench.scene import DirectionalLight, Light, Mesh, PointLight, RectangularLight, Rotation, SpotLight
from shadowbench.world import Casters, World

_BAND_HEIGHT = 8
"""Rows of the picture that every caster is applied to before the next ones: their receivers fit a core's cache."""

_BLOCK_LENGTH = 1 << 12
"""Receivers that query all maps in one go."""

_MOST_TEXELS = 2**31 - 1
"""Over all maps: an array's places are numbered by int32."""

_LEAST_RESOLUTION = 16
"""Of a map by importance [texels]."""


class InstancedParameters(DepthMapParameters):
    resolution: int = parameter(
        512, unit="texels", help="Width and height of each map, or of the largest.", ge=1, le=16384
    )
    bias: float = parameter(
        1.0e-5, unit="depth", help="Constant bias, as a share of the caster's own depth range.", ge=0.0, le=1.0
    )
    slope_bias: float = parameter(
        1.0, unit="texels", help="Polygon offset: stored depths grow by this many texels of slope.", ge=0.0, le=64.0
    )
    sizing: Literal["fixed", "importance"] = parameter(
        "fixed", unit="1", help="All maps alike, or each with a texel for a pixel of its largest instance."
    )
    rotation: Literal["exact", "nearest", "interpolated-depth", "interpolated-result"] = parameter(
        "interpolated-depth", unit="1", help="Which maps stand for a rotated instance under parallel light."
    )
    step: float = parameter(30.0, unit="degrees", help="Between the angles of maps; divides 360.", gt=0.0, le=360.0)
    application: Literal["volumes", "all-maps"] = parameter(
        "volumes", unit="1", help="Look up candidates in each caster's shadow volume, or every map for every receiver."
    )
    candidates: Literal["z-pass", "z-fail"] = parameter(
        "z-pass", unit="1", help="Which test comes first: for entering the volume, or for leaving it."
    )
    skip_other_test: bool = parameter(False, unit="1", help="Look up what passed the first test.")

    @field_validator("step")
    @classmethod
    def _divides_the_circle(cls, step: float) -> float:
        steps = 360.0 / step
        if abs(steps - round(steps)) > 1.0e-9 * steps:
            raise ValueError(f"maps are spaced evenly round the circle, but 360 / {step:g} is no whole number")
        return step


class Instanced(Method):
    """A map for each object, shared by instances, applied to the receivers in each object's shadow volume."""

    name = "instanced"
    title = "Instanced shadow maps"
    source = "Buntin & Stamminger 2007"
    Parameters = InstancedParameters
    counters: ClassVar[dict[str, str]] = {
        "maps built": "maps drawn by build()",
        "triangles drawn": "the mesh's triangles, over the maps drawn",
        "map texels": "texels over all maps that are kept",
        "fill": "receivers under the outline of a caster's shadow volume, over all casters",
        "candidates": "valid receivers within a caster's shadow volume, over all casters",
        "look-ups": "receivers looked up in a caster's map (or in its two neighbouring maps), over all casters",
        "largest overdraw": "look-ups of the receiver that has the most",
        "shadowed": "look-ups that found the receiver in shadow, if only in one of two maps",
    }

    parameters: InstancedParameters
    _view: View
    _mesh_list: tuple[Mesh, ...]
    _pairs: Pairs | None = None

    def is_view_dependent(self) -> bool:
        return self.parameters.sizing == "importance"

    def supports(self, world: World, light: Light) -> str | None:
        if isinstance(light, RectangularLight):
            return "an area light has no depth map"
        return None

    def build(self, casters: Casters, light: Light, view: View, changes: Changes, trace: Trace) -> None:
        self._view, self._mesh_list = view, casters.meshes
        if self._pairs is None:
            self._meshes = CasterMeshes(self.context.device)
            self._drawer = CasterMapDrawer(self._meshes, self.parameters.slope_bias, self.context)
            self._no_counts = wp.empty(0, dtype=wp.int32, device=self.context.device)
            self._overdraw = self._no_counts
        drawn: list[MapRequest] = []
        with trace.stage("casters"):
            moved = changes.light or bool(changes.instances) or self._pairs is None
            if moved:
                self._pairs = pair_up(casters, light, self._neighbours, self.parameters.bias, self._meshes)
                self._volumes = BoundingVolumes(self._pairs.boxes, homogeneous(light), casters.world, self.context)
        if moved or (changes.view and self.is_view_dependent()):
            assert self._pairs is not None
            with trace.stage("shadow maps"):
                resolutions = self._resolutions(self._pairs, view)
                drawn = self._drawer.draw(self._pairs.requests, resolutions, casters, anew=changes.light)
            self._maps = self._pairs.packed(self._drawer.pool)
        trace.count("maps built", len(drawn))
        trace.count("triangles drawn", sum(casters.meshes[request.mesh].triangle_count for request in drawn))
        trace.count("map texels", self._drawer.pool.depth.size)
        trace.keep("shadow maps", self._drawer.pool.depth)

    def shade(self, receivers: Receivers, visibility: wp.array[Any], trace: Trace) -> None:
        by_channel = visibility.reshape((receivers.count, -1))
        self._is_by_channel = visibility.ndim > 1
        to_candidates, to_all = self._kernels()
        if self.parameters.application == "volumes":
            nothing = self._no_counts, self._no_counts
            self._apply_to_candidates(to_candidates, receivers, by_channel, nothing, trace)
        else:
            self._apply_to_all(to_all, receivers, by_channel, trace)

    def explain(self, receivers: Receivers, trace: Trace) -> None:
        """Draw the maps, and report who was a candidate and the picture of the overdraw (Fig. 4)."""
        from shadowbench.methods.instanced.pictures import maps_picture

        assert self._pairs is not None
        maps = maps_picture(self._pairs.requests, self._drawer.pool, self._mesh_list)
        if maps is not None:
            trace.picture("depth map", maps)
        if self.parameters.application == "volumes":
            device = self.context.device
            again = wp.empty((receivers.count, 1), dtype=wp.float32, device=device)
            covered, candidates = (wp.zeros(receivers.count, dtype=wp.int32, device=device) for _ in range(2))
            counts = covered, candidates
            self._apply_to_candidates(self._kernels()[0], receivers, again, counts, Trace(self.context))
            trace.mask("candidates", candidates.numpy() > 0)
            trace.heat("fill", covered.numpy())
            trace.heat("overdraw", self._overdraw.numpy()[: receivers.count])

    def account(self, receivers: Receivers, index: int) -> Account:
        from shadowbench.methods.instanced.accounts import account_of

        volumes = None
        if self.parameters.application == "volumes":
            volumes = self._volumes
            volumes.outline(receivers, self._view.frame, exits_first=self.parameters.candidates == "z-fail")
        return account_of(
            receivers.only(index),
            self._maps,
            volumes,
            self._kernels()[1],
            is_by_channel=self._is_by_channel,
            skips_other_test=self.parameters.skip_other_test,
            context=self.context,
        )

    def _neighbours(self, rotation: Rotation) -> angles.Neighbours:
        step_count = round(360.0 / self.parameters.step)
        match self.parameters.rotation:
            case "exact":
                return angles.exact(rotation)
            case "nearest":
                return angles.nearest(rotation, step_count)
            case _:
                return angles.interpolated(rotation, step_count)

    def _resolutions(self, pairs: Pairs, view: View) -> dict[MapKey, int]:
        """Return each map's resolution: as the parameter says, or by importance a texel a pixel, a power of two."""
        largest = self.parameters.resolution
        found = dict.fromkeys(pairs.requests, largest)
        if self.is_view_dependent():
            pixels = sizes_in_picture(pairs.boxes, view)
            for key, request in pairs.requests.items():
                wanted = math.ceil(min(float(pixels[request.casters].max()), largest))
                found[key] = min(max(1 << (wanted - 1).bit_length(), _LEAST_RESOLUTION), largest)
        texel_count = sum(resolution * resolution for resolution in found.values())
        if texel_count > _MOST_TEXELS:
            raise ParameterError(
                f"method 'instanced': {len(found)} maps take {texel_count} texels, but no more than {_MOST_TEXELS} can "
                "be kept; choose a lower resolution"
            )
        return found

    def _kernels(self) -> tuple[wp.Kernel, wp.Kernel]:
        """Return the kernels with the look-up that the light and the maps need."""
        assert self._pairs is not None, "build() comes before shade()"
        if isinstance(self._pairs.light, PointLight):
            return kernels.faces_to_candidates, kernels.faces_to_all
        if isinstance(self._pairs.light, SpotLight):
            return kernels.spot_to_candidates, kernels.spot_to_all
        if not self._pairs.are_interpolated:
            return kernels.one_map_to_candidates, kernels.one_map_to_all
        if self.parameters.rotation == "interpolated-result":
            return kernels.results_to_candidates, kernels.results_to_all
        return kernels.depths_to_candidates, kernels.depths_to_all

    def _apply_to_candidates(
        self,
        kernel: wp.Kernel,
        receivers: Receivers,
        visibility: wp.array[Any],
        by_receiver: tuple[wp.array[Any], wp.array[Any]],
        trace: Trace,
    ) -> None:
        device = self.context.device
        if self._overdraw.shape[0] < receivers.count:
            self._overdraw = wp.empty(receivers.count, dtype=wp.int32, device=device)
        with trace.stage("volumes"):
            self._volumes.outline(receivers, self._view.frame, exits_first=self.parameters.candidates == "z-fail")
            band_count = -(-receivers.height // _BAND_HEIGHT)
            counts = wp.empty((band_count, kernels.COUNTER_COUNT), dtype=wp.int64, device=device)
            cuts = self._volumes.cuts(_BAND_HEIGHT, band_count)
        on_device = receivers.on(device)
        with trace.stage("look-up"):
            launch(
                kernel,
                band_count,
                inputs=[
                    self._maps,
                    self._volumes.planes.flatten(),
                    self._volumes.plane_counts,
                    self._volumes.lines,
                    self._volumes.line_counts,
                    self._volumes.rows,
                    self.parameters.skip_other_test,
                    receivers.width,
                    receivers.height,
                    _BAND_HEIGHT,
                    as_warp(receivers.first_of_pixel, wp.int32, device),
                    on_device.position,
                    on_device.valid,
                ],
                outputs=[visibility, self._overdraw, *by_receiver, counts],
                context=self.context,
                cuts=cuts,
            )
        by_band = counts.numpy()
        for column, name in enumerate(("fill", "candidates", "look-ups", "shadowed")):
            trace.count(name, int(by_band[:, column].sum()))
        trace.count("largest overdraw", int(by_band[:, kernels.LARGEST_OVERDRAW].max()))

    def _apply_to_all(self, kernel: wp.Kernel, receivers: Receivers, visibility: wp.array[Any], trace: Trace) -> None:
        device = self.context.device
        on_device = receivers.on(device)
        block_count = -(-receivers.count // _BLOCK_LENGTH)
        counts = wp.zeros((block_count, kernels.COUNTER_COUNT), dtype=wp.int64, device=device)
        with trace.stage("look-up"):
            launch(
                kernel,
                block_count,
                inputs=[self._maps, _BLOCK_LENGTH, on_device.position, on_device.valid],
                outputs=[visibility, counts],
                context=self.context,
            )
        by_block = counts.numpy()
        trace.count("look-ups", int(by_block[:, kernels.LOOK_UPS].sum()))
        trace.count("shadowed", int(by_block[:, kernels.SHADOWED].sum()))


def homogeneous(light: Light) -> tuple[float, float, float, float]:
    """Return a light as (position, 1) or (direction towards it, 0)."""
    if isinstance(light, DirectionalLight):
        return (*light.direction, 0.0)
    assert not isinstance(light, RectangularLight)
    return (*light.position, 1.0)


def sizes_in_picture(boxes: OrientedBoxes, view: View) -> NDArray[np.float64]:
    """Return the diameter of each box's sphere in the picture [pixels]; infinite if the eye is within it."""
    corners = turned(boxes.world_from_box[:, None], corners_of(boxes.half))
    radius_squared = (corners * corners).sum(axis=2).max(axis=1)
    offset = boxes.centre - np.asarray(view.camera.eye)
    # from outside a sphere is seen under an angle whose half has the tangent radius / sqrt(distance² - radius²)
    beyond = (offset * offset).sum(axis=1) - radius_squared
    per_tangent = max(view.width / view.frame.extent[0], view.height / view.frame.extent[1])
    with np.errstate(divide="ignore"):
        tangent = np.sqrt(radius_squared / np.maximum(beyond, 0.0))
    return 2.0 * per_tangent * tangent
