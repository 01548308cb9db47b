"""Embree as a peer: shadow rays through Intel's ray tracer, on the same receivers.

Embree (Wald et al. 2014, *Embree: A Kernel Framework for Efficient CPU Ray Tracing*) is what a CPU renderer would use,
and its rays are what its user would write: float32, started ``offset`` along the normal on the light's side. They are
bit for bit the rays of ``ray-traced`` with ``self_hit=offset``, so the two tracers can be compared ray by ray; against
the ground truth, the failure percentage is that of the offset rule. Robust mode is used, in which Embree's triangles
share edges without gaps up to float32 rounding.

Read the times with this in mind. Rays go one at a time through the Python binding's loop, which holds no lock: blocks
of them are traced from ``threads`` threads. The tree is built by Embree's own pool, which takes as many threads as the
process could use when Embree first built something in it; that moment is confined to ``threads`` processors where the
system allows. *buffer copy* is the binding's element-by-element copy of the mesh, which another binding would not
need: it stands apart from *BVH construction*. The binding does not say how large the tree is; what is known and
reported is Embree's copy of the triangles, and the flat copy of all instances that it is made from, where the scene
has none of its own: the binding knows no instances.

Limits: opaque casters and lights without area. Needs the extra ``peers`` (embreex 4.4 or newer).
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from importlib.metadata import PackageNotFoundError, version
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from shadowbench.device.processors import confined_to
from shadowbench.device.rays import OffsetRays
from shadowbench.light_space import is_in_field_of_view
from shadowbench.method import Changes, Context, Method, Trace, View
from shadowbench.parameters import ParameterModel, parameter
from shadowbench.receivers import Receivers
from shadowbench.scene import Light, RectangularLight
from shadowbench.world import Casters, World

if TYPE_CHECKING:
    import warp as wp

_OLDEST = (4, 4)
"""The first embreex over Embree 4, with a choice of robust mode and rays traced without the interpreter lock."""

_BLOCKS_PER_THREAD = 8

_VERTEX_BYTES, _TRIANGLE_BYTES = 16, 12
"""What embreex allocates in Embree for each."""


class EmbreeParameters(ParameterModel):
    offset: float = parameter(
        1.0e-5,
        unit="scene diagonals",
        help="How far off its surface a ray starts, along the normal on the light's side.",
        ge=0.0,
        le=0.1,
    )


class Embree(Method):
    """Occlusion rays through Embree 4."""

    name = "embree"
    title = "Embree"
    source = "Wald et al. 2014; Embree 4 through embreex"
    Parameters = EmbreeParameters
    self_hit = "offset"
    counters: ClassVar[dict[str, str]] = {"rays": "valid receivers within the light's field of view"}

    parameters: EmbreeParameters
    _scene: Any = None
    _light: Light
    _offset: float
    _copied: int = 0
    _flattened: int = 0

    def __init__(self, parameters: EmbreeParameters, context: Context) -> None:
        super().__init__(parameters, context)
        self._pool = ThreadPoolExecutor(context.threads, thread_name_prefix="shadowbench-embree")

    @classmethod
    def library_versions(cls) -> dict[str, str]:
        return {"embreex": version("embreex")}

    @classmethod
    def available(cls) -> str | None:
        try:
            installed = version("embreex")
            import embreex.rtcore_scene  # noqa: F401 - whether its library loads is the question
        except (PackageNotFoundError, ImportError) as error:
            missing = isinstance(error, PackageNotFoundError)
            why = "embreex is not installed" if missing else f"embreex cannot be imported ({error})"
            return f"{why}: pip install 'shadowbench[peers]'"
        if tuple(int(part) for part in installed.split(".")[:2]) < _OLDEST:
            return f"embreex {installed} is too old, {_OLDEST[0]}.{_OLDEST[1]} or newer is needed"
        return None

    def supports(self, world: World, light: Light) -> str | None:
        if isinstance(light, RectangularLight):
            return "an area light needs many rays a receiver"
        if not world.casters.is_opaque:
            return "a ray is either blocked or not: opaque casters only"
        return None

    def self_hit_rule(self) -> str:
        return f"offset:{self.parameters.offset:g}"

    def build(self, casters: Casters, light: Light, view: View, changes: Changes, trace: Trace) -> None:
        self._light = light
        self._offset = self.parameters.offset * casters.world.diagonal()
        if casters.triangle_count == 0:
            self._scene, self._copied, self._flattened = None, 0, 0
        elif self._scene is None or changes.instances:
            flat = casters.flat()
            from embreex.mesh_construction import TriangleMesh
            from embreex.rtcore_scene import EmbreeScene

            with confined_to(self.context.threads):
                with trace.stage("buffer copy"):
                    self._scene = EmbreeScene(robust=True)
                    TriangleMesh(self._scene, flat.vertices, flat.triangles)
                with trace.stage("BVH construction"):
                    # embreex commits with the first ray; this one points away from everything and ends at once
                    nowhere = np.ones((1, 3), np.float32)
                    self._scene.run(nowhere, nowhere, dists=np.zeros(1, np.float32), query="OCCLUDED")
            self._copied = _VERTEX_BYTES * len(flat.vertices) + _TRIANGLE_BYTES * len(flat.triangles)
            self._flattened = 0 if casters.is_flat else flat.byte_count
        trace.keep_bytes("triangle buffers", self._copied)
        if self._flattened:
            trace.keep_bytes("flattened instances", self._flattened)

    def shade(self, receivers: Receivers, visibility: wp.array[Any], trace: Trace) -> None:
        with trace.stage("field of view"):
            asked = receivers.valid & is_in_field_of_view(self._light, receivers.position)
            kept = slice(None) if asked.all() else np.flatnonzero(asked)
        with trace.stage("ray generation"):
            rays = OffsetRays(receivers, self._light, self._offset, self.context)
            origin, towards, reach = (a.numpy()[kept] for a in (rays.origin, rays.towards, rays.reach))
        with trace.stage("shadow rays"):
            lit = visibility.numpy()
            lit[:] = 0.0
            lit[kept] = ~self._are_blocked(origin, towards, reach)
        trace.count("rays", len(origin))

    def _are_blocked(
        self, origin: NDArray[np.float32], towards: NDArray[np.float32], reach: NDArray[np.float32]
    ) -> NDArray[np.bool_]:
        """Return which rays hit anything; blocks of rays are traced side by side."""
        count = len(origin)
        blocked = np.zeros(count, dtype=bool)
        if self._scene is None:
            return blocked
        size = max(1, -(-count // (_BLOCKS_PER_THREAD * self.context.threads)))

        def trace_block(first: int) -> None:
            block = slice(first, first + size)
            found = self._scene.run(origin[block], towards[block], dists=reach[block], query="OCCLUDED")
            blocked[block] = found >= 0

        for _ in self._pool.map(trace_block, range(0, count, size)):
            pass
        return blocked

    def close(self) -> None:
        self._pool.shutdown()
        self._scene = None
