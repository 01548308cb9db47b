"""Ray-traced hard shadows: one ray a receiver, answered exactly.

A shadow ray asks whether anything lies between a surface point and the light (Appel 1968; Whitted 1980). Finding that
out is the tree's business; the hard part is the ray's start, which lies on a surface and must not be shadowed by it.
Two rules (``self_hit``):

* ``plane``, the ground truth's own (:mod:`shadowbench.reference`): the ray starts on the surface, and triangles whose
  plane passes through its start within 16 ulp of the scene's size do not count. Equal to the reference on every
  receiver, bit for bit: what it costs to be right.
* ``offset``, the common rule: the ray starts ``offset`` along the normal, on the light's side, and everything it
  crosses counts. Too small and surfaces shadow themselves, too large and contact shadows are lost and thin gaps are
  leapt; its failure percentage says how much. It answers for the side of a surface that faces the light, also where
  the camera sees the other one (receivers turned away are scored apart). The float32 rays are the ones that the peer
  ``embree`` traces.

Through translucent casters a ray of ``plane`` goes on, dimmed by each crossing, channel by channel.

Limits: no filtering, so shadow edges alias in the picture as every hard test does. Cost: building sorts the triangles
once along a space-filling curve (:mod:`shadowbench.device.triangle_tree`) and is skipped when only the light moved;
shading grows with the logarithm of the triangle count. A scene of many instances has one tree a mesh and one over the
instances (:mod:`shadowbench.device.instance_forest`), with the same answers, and only the latter is built again when
they move.
"""

from __future__ import annotations

from typing import Any, ClassVar, Literal

import numpy as np
import warp as wp
from numpy.typing import NDArray

from shadowbench.device.arrays import as_warp
from shadowbench.device.instance_forest import InstanceForest, tree_over
from shadowbench.device.launch import launch
from shadowbench.device.rays import OffsetRays, find_turned_away
from shadowbench.device.translucency import trace_through
from shadowbench.device.triangle_tree import TriangleTree
from shadowbench.device.visibility import light_point, plane_tolerance
from shadowbench.light_space import is_in_field_of_view
from shadowbench.method import Changes, Method, Trace, View
from shadowbench.methods.ray_traced.kernels import (
    trace_from_offset,
    trace_from_offset_in_forest,
    trace_from_surface,
    trace_from_surface_in_forest,
)
from shadowbench.parameters import ParameterModel, parameter
from shadowbench.receivers import Receivers
from shadowbench.scene import Light, RectangularLight
from shadowbench.world import Casters, World

AnyTree = TriangleTree | InstanceForest


class RayTracedParameters(ParameterModel):
    self_hit: Literal["plane", "offset"] = parameter(
        "plane", unit="1", help="How a surface is kept from shadowing itself: plane (exact) or offset (the common way)."
    )
    offset: float = parameter(
        1.0e-5,
        unit="scene diagonals",
        help="How far off its surface a ray starts, with self_hit=offset.",
        ge=0.0,
        le=0.1,
    )


class RayTraced(Method):
    """One shadow ray a receiver through a bounding-volume hierarchy."""

    name = "ray-traced"
    title = "Ray tracing"
    source = "Appel 1968, Some techniques for shading machine renderings of solids"
    Parameters = RayTracedParameters
    self_hit = "plane"
    counters: ClassVar[dict[str, str]] = {"rays": "valid receivers within the light's field of view"}

    parameters: RayTracedParameters
    _tree: AnyTree | None = None
    _casters: Casters
    _light: Light
    _offset: float

    def supports(self, world: World, light: Light) -> str | None:
        if isinstance(light, RectangularLight):
            return "an area light needs many rays a receiver"
        if not world.casters.is_opaque and self.parameters.self_hit == "offset":
            return "an offset ray is either blocked or not: opaque casters only (self_hit=plane counts crossings)"
        return None

    def self_hit_rule(self) -> str:
        if self.parameters.self_hit == "offset":
            return f"offset:{self.parameters.offset:g}"
        return "plane"

    def build(self, casters: Casters, light: Light, view: View, changes: Changes, trace: Trace) -> None:
        self._casters, self._light = casters, light
        self._offset = self.parameters.offset * casters.world.diagonal()
        with trace.stage("BVH construction"):
            if self._tree is None or not self._tree.fits(casters):
                self._tree = tree_over(casters, self.context)
                self._tree.build(casters)
            elif changes.instances:
                self._tree.build(casters)
        trace.keep("BVH boxes", self._tree.bounds)
        if isinstance(self._tree, InstanceForest):
            trace.keep("BVH boxes of instances", self._tree.over)
        trace.keep("BVH triangles", self._tree.corners)

    def shade(self, receivers: Receivers, visibility: wp.array[Any], trace: Trace) -> None:
        assert self._tree is not None, "build() comes before shade()"
        with trace.stage("field of view"):
            asked = receivers.valid & is_in_field_of_view(self._light, receivers.position)
        if not self._casters.is_opaque:
            self._trace_through(receivers, asked, visibility, trace)
        elif self.parameters.self_hit == "plane":
            self._trace_from_surface(self._tree, receivers, asked, visibility, trace)
        else:
            self._trace_from_offset(self._tree, receivers, asked, visibility, trace)
        trace.count("rays", int(np.count_nonzero(asked)))

    def _trace_from_surface(
        self, tree: AnyTree, receivers: Receivers, asked: NDArray[np.bool_], visibility: wp.array[Any], trace: Trace
    ) -> None:
        device = self.context.device
        on_device, lookup = receivers.on(device), self._casters.world.lookup(device)
        with trace.stage("shadow rays"):
            launch(
                trace_from_surface_in_forest if isinstance(tree, InstanceForest) else trace_from_surface,
                receivers.count,
                inputs=[
                    tree.packed(),
                    light_point(self._light),
                    wp.vec3d(*receivers.eye),
                    plane_tolerance(self._casters.scale),
                    lookup,
                    as_warp(asked.view(np.uint8), wp.uint8, device),
                    on_device.position,
                    on_device.triangle,
                ],
                outputs=[visibility],
                context=self.context,
            )

    def _trace_through(
        self, receivers: Receivers, asked: NDArray[np.bool_], visibility: wp.array[Any], trace: Trace
    ) -> None:
        assert self._tree is not None
        device = self.context.device
        on_device, lookup = receivers.on(device), self._casters.world.lookup(device)
        turned_away = wp.empty(receivers.count, dtype=wp.uint8, device=device)
        with trace.stage("shadow rays"):
            eye = wp.vec3d(*receivers.eye)
            inputs = [light_point(self._light), eye, lookup, on_device.triangle]
            launch(find_turned_away, receivers.count, inputs=inputs, outputs=[turned_away], context=self.context)
            facing = asked & ~turned_away.numpy().astype(bool)
            trace_through(
                self._tree,
                self._casters,
                self._light,
                asked=as_warp(facing.view(np.uint8), wp.uint8, device),
                position=on_device.position,
                visibility=visibility,
                context=self.context,
            )

    def _trace_from_offset(
        self, tree: AnyTree, receivers: Receivers, asked: NDArray[np.bool_], visibility: wp.array[Any], trace: Trace
    ) -> None:
        with trace.stage("ray generation"):
            rays = OffsetRays(receivers, self._light, self._offset, self.context)
        with trace.stage("shadow rays"):
            launch(
                trace_from_offset_in_forest if isinstance(tree, InstanceForest) else trace_from_offset,
                receivers.count,
                inputs=[
                    tree.packed(),
                    as_warp(asked.view(np.uint8), wp.uint8, self.context.device),
                    rays.origin,
                    rays.towards,
                    rays.reach,
                ],
                outputs=[visibility],
                context=self.context,
            )
