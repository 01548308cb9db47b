"""What the exact rasterising methods have in common: receivers become samples of the light's window.

A subclass names the rasteriser over the samples (a tree, cells) and what it counts; placing the samples, passing the
casters over them window by window, and the pictures of the light's image plane are the same for all.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterable
from typing import Any, ClassVar, Generic, Protocol, TypeVar

import numpy as np
import warp as wp
from numpy.typing import NDArray

from shadowbench.device.blocker_bins import Transmittances, transmittances_of
from shadowbench.device.light_samples import LightSamples, WindowSamples
from shadowbench.device.placed_triangles import TriangleBatch
from shadowbench.device.sample_scan import SampleArrays
from shadowbench.light_picture import LightPlane, light_space_pictures
from shadowbench.method import Changes, Method, Trace, View
from shadowbench.receivers import Receivers
from shadowbench.scene import Light, RectangularLight
from shadowbench.world import Casters, World

Counts = TypeVar("Counts")
Counts_co = TypeVar("Counts_co", covariant=True)

TESTED = (
    "receivers in no shadow yet that a caster's triangle covers, or may cover, in the light's window, not counting "
    "those in its own plane; over all triangles in file order"
)
"""What the alias-free paper's *sampling points tested* counts here."""


class IrregularRasterizer(Protocol[Counts_co]):
    """Samples of one window in a structure, and casters over them; memory is kept between frames."""

    samples: SampleArrays

    @property
    def kept_bytes(self) -> int:
        """Memory that stays alive between frames [bytes]."""

    def transform(self, window: WindowSamples, transmittances: Transmittances) -> None:
        """Transform a window's samples; the transmittances are those of the casters to come."""

    def build(self) -> None:
        """Build the structure over them."""

    def cells(self) -> NDArray[np.float32]:
        """Return boxes (low x, low y, high x, high y) that show the structure, in window coordinates, shape [n, 4]."""

    def rasterize(self, casters: Iterable[TriangleBatch]) -> Counts_co:
        """Let triangles shadow the samples, batch by batch in file order; returns what it took."""

    def write(self, visibility: wp.array[Any]) -> None:
        """Set the visibility of all sampled points, float32, shape [point_count] or [point_count, 3]."""


class IrregularMethod(Method, Generic[Counts]):
    """Rasterisation of casters at the receivers' own places in the light's window: one, or six around a point light."""

    self_hit = "plane"
    structure_stage: ClassVar[str]
    """What building the structure is called in tables."""
    structure_title: ClassVar[str]
    """What the structure is called among what is kept, and in its picture."""

    _casters: Casters
    _light: Light
    _transmittances: Transmittances
    _samples: LightSamples
    _rasterizer: IrregularRasterizer[Counts]

    @abstractmethod
    def make_rasterizer(self) -> IrregularRasterizer[Counts]:
        """Return the rasteriser that the parameters ask for."""

    @abstractmethod
    def report(self, rasterizer: IrregularRasterizer[Counts], counts: Counts, trace: Trace) -> None:
        """Count what a window took."""

    def supports(self, world: World, light: Light) -> str | None:
        if isinstance(light, RectangularLight):
            return "an area light has no hard shadow"
        return None

    def build(self, casters: Casters, light: Light, view: View, changes: Changes, trace: Trace) -> None:
        self._casters, self._light = casters, light
        self._transmittances = transmittances_of(casters, self.context.device)
        if changes.light:
            self._samples = LightSamples(self.context)
            self._rasterizer = self.make_rasterizer()

    def shade(self, receivers: Receivers, visibility: wp.array[Any], trace: Trace) -> None:
        with trace.stage("transformation"):
            windows = self._samples.place_receivers(receivers, self._light, self._casters.world, visibility)
        for window in windows:
            with trace.stage("transformation"):
                self._rasterizer.transform(window, self._transmittances)
            with trace.stage(self.structure_stage):
                self._rasterizer.build()
            with trace.stage("rasterization"):
                counts = self._rasterizer.rasterize(self._casters.batches(self.context))
                self._rasterizer.write(visibility)
            self.report(self._rasterizer, counts, trace)
        trace.keep_bytes("windows of the receivers", self._samples.kept_bytes)
        trace.keep_bytes(f"{self.structure_title} and lists of triangles", self._rasterizer.kept_bytes)

    def explain(self, receivers: Receivers, trace: Trace) -> None:
        """Draw the samples in the light's image plane and the structure over them (paper, Figures 2b and 4)."""
        visibility = wp.empty(receivers.count, dtype=wp.float32, device=self.context.device)
        rasterizer, planes = self.explaining_rasterizer(), []
        for window in self._samples.place_receivers(receivers, self._light, self._casters.world, visibility):
            rasterizer.transform(window, self._transmittances)
            rasterizer.build()
            counts = rasterizer.rasterize(self._casters.batches(self.context))
            self.explain_window(rasterizer, counts, trace)
            rasterizer.write(visibility)
            samples, count = rasterizer.samples, window.count
            source = samples.source.numpy()[:count]
            place = np.stack([samples.x.numpy()[:count], samples.y.numpy()[:count]], axis=1)
            is_lit = visibility.numpy()[source] >= 0.5
            planes.append(LightPlane(window.number, place, receivers.pixel[source], is_lit, rasterizer.cells()))
        for name, picture in light_space_pictures(planes, receivers.width, self.structure_title).items():
            trace.picture(name, picture)

    def explaining_rasterizer(self) -> IrregularRasterizer[Counts]:
        """Return the rasteriser that :meth:`explain` runs."""
        return self._rasterizer

    def explain_window(self, rasterizer: IrregularRasterizer[Counts], counts: Counts, trace: Trace) -> None:
        """Count what only an untimed pass can."""
