"""The interface of a shadow technique, and the trace it reports through.

A method is one class: ``build()`` is paid when the light or a caster moves, ``shade()`` every frame. Everything the
tables show beside visibility and wall time (stages, counters, masks, what stays alive) goes through the
:class:`Trace`. A method may use Warp kernels or none at all: on the CPU every array is a NumPy view.
"""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel

from shadowbench.account import Account
from shadowbench.device.launch import Context, synchronize
from shadowbench.light_space import Frame
from shadowbench.light_space_kernel import LightSpaceKernel
from shadowbench.receivers import Receivers
from shadowbench.scene import Camera, Light, NoParameters
from shadowbench.world import Casters, World

if TYPE_CHECKING:
    import warp as wp

__all__ = ["Account", "Changes", "Context", "LightSpaceKernel", "Method", "Trace", "View"]


@dataclass(frozen=True)
class View:
    """What the camera sees, for methods whose maps depend on it.

    Attributes:
        camera: In the recentred world.
        width, height: Picture size [pixels].
        frame: The camera's frame.
    """

    camera: Camera
    width: int
    height: int
    frame: Frame


@dataclass(frozen=True)
class Changes:
    """What moved since the last ``build()`` of this method object.

    Attributes:
        light: The light moved, or this is the first build.
        instances: Indices of casting instances that moved or whose mesh changed; all of them on the first build.
        view: The camera moved.
    """

    light: bool
    instances: frozenset[int]
    view: bool


@dataclass(eq=False)
class Trace:
    """What a method reports beside visibility.

    Attributes:
        stages: Stage name to duration [ms], in order of first use; a stage entered twice adds up.
        counters: Counter name to value. Counters are machine-independent and gated exactly.
        masks: Mask name to bool per receiver.
        heats: Picture name to a number per receiver.
        kept: Array name to the array that stays alive between frames (memory, and pictures for the report).
        kept_bytes: Name to bytes that stay alive without being an array.
        pictures: Picture name to 8-bit sRGB, shape [height, width, 3].
    """

    context: Context = field(default_factory=Context)
    stages: dict[str, float] = field(default_factory=dict)
    counters: dict[str, int] = field(default_factory=dict)
    masks: dict[str, NDArray[np.bool_]] = field(default_factory=dict)
    heats: dict[str, NDArray[Any]] = field(default_factory=dict)
    kept: dict[str, Any] = field(default_factory=dict)
    kept_bytes: dict[str, int] = field(default_factory=dict)
    pictures: dict[str, NDArray[np.uint8]] = field(default_factory=dict)

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Time a stage; synchronises the device at its end. Use the names of the paper's table where it has one."""
        begin = time.perf_counter()
        try:
            yield
        finally:
            synchronize(self.context)
            self.stages[name] = self.stages.get(name, 0.0) + (time.perf_counter() - begin) * 1.0e3

    def count(self, name: str, value: int) -> None:
        """Add to a counter. Must not depend on the thread count or the machine."""
        self.counters[name] = self.counters.get(name, 0) + int(value)

    def mask(self, name: str, values: NDArray[Any]) -> None:
        """Report receivers by a test of the method's own, e.g. ``classified``; shape [receiver_count]."""
        self.masks[name] = np.asarray(values).astype(bool)

    def heat(self, name: str, values: NDArray[Any]) -> None:
        """Report a number per receiver, 0 or more, to be seen as a heat map; shape [receiver_count]."""
        self.heats[name] = np.asarray(values)

    def keep(self, name: str, array: wp.array[Any] | NDArray[Any]) -> None:
        """Report an array that stays alive between frames. Nothing is copied here."""
        self.kept[name] = array

    def keep_bytes(self, name: str, byte_count: int) -> None:
        """Report memory that stays alive but is no array (a peer's acceleration structure, say)."""
        self.kept_bytes[name] = int(byte_count)

    def picture(self, name: str, image: NDArray[np.uint8]) -> None:
        """Give the report a picture of the method's own, from ``explain()``; sRGB, shape [height, width, 3]."""
        if image.dtype != np.uint8 or image.ndim != 3 or image.shape[2] != 3:
            raise ValueError(f"picture '{name}' must be uint8 of shape [height, width, 3]")
        self.pictures[name] = image

    def bytes_by_name(self) -> dict[str, int]:
        """Return what stays alive between frames [bytes]."""
        arrays = {name: int(array.size) * _item_bytes(array) for name, array in self.kept.items()}
        return arrays | self.kept_bytes


def _item_bytes(array: Any) -> int:
    """Bytes of one element; for a Warp array of vectors ``size`` counts vectors."""
    if isinstance(array, np.ndarray):
        return array.itemsize
    return int(array.capacity // array.size) if array.size else 0


class Method(ABC):
    """A shadow technique.

    One object serves one case: it is made, built once or more, shaded many times, then closed. The docstring of a
    method's module names the paper, the idea, the limits and the cost; ``shadowbench show NAME`` prints it.

    The contract, held by one suite over every method found (``shadowbench check``):

    * ``shade`` writes every valid receiver: 1 lit, 0 shadowed, between for filtered; never NaN.
    * The same bits come out on every repeat and for every thread count, and so do the counters.
    * A receiver outside the light's field of view is shadowed, whatever the method writes there: it is not scored, and
      the harness sets it to 0 before it measures and draws.
    * What was reported through ``trace.keep`` in ``build`` is what ``shade`` needs alive.
    """

    name: ClassVar[str]
    """What the command line and the tables call it: lower case, hyphens."""
    title: ClassVar[str]
    source: ClassVar[str] = ""
    """Paper, section; or the library behind a peer."""
    Parameters: ClassVar[type[BaseModel]] = NoParameters
    devices: ClassVar[frozenset[str]] = frozenset({"cpu"})
    deterministic: ClassVar[bool] = True
    """``False`` for a peer: receivers that change between repeats are counted, not an error."""
    view_dependent: ClassVar[bool] = False
    """``True``: ``build()`` belongs to every frame, whatever the parameters (see :meth:`is_view_dependent`)."""
    self_hit: ClassVar[str] = ""
    """For a method that traces rays: how it keeps a surface from shadowing itself (``plane``, ``offset``)."""
    counters: ClassVar[dict[str, str]] = {}
    """Each counter it reports and what it counts, for ``shadowbench show``."""

    def __init__(self, parameters: Any, context: Context) -> None:
        """Keep the parameters (an instance of :attr:`Parameters`) and where to run."""
        self.parameters = parameters
        self.context = context

    @classmethod
    def available(cls) -> str | None:
        """Return why the method cannot run on this machine (a missing extra, say), or ``None`` if it can."""
        return None

    @classmethod
    def library_versions(cls) -> dict[str, str]:
        """Return the versions of libraries, other than Warp, on which its results depend: another is another result."""
        return {}

    def supports(self, world: World, light: Light) -> str | None:
        """Return a reason to skip this scene and light, or ``None``."""
        return None

    def is_view_dependent(self) -> bool:
        """Return whether ``build()`` belongs to every frame, with these parameters."""
        return self.view_dependent

    @abstractmethod
    def build(self, casters: Casters, light: Light, view: View, changes: Changes, trace: Trace) -> None:
        """Prepare for a light and its casters: draw maps, build trees."""

    @abstractmethod
    def shade(self, receivers: Receivers, visibility: wp.array[Any], trace: Trace) -> None:
        """Write the visibility of every valid receiver.

        Args:
            receivers: The visible samples.
            visibility: float32, shape [receiver_count], or [receiver_count, 3] where casters have a coloured
                transmittance; filled with NaN by the harness. On the CPU ``visibility.numpy()`` is a view of it.
            trace: Where stages, counters and masks go.
        """

    def self_hit_rule(self) -> str:
        """Return the value of the row's ``self_hit`` column, e.g. ``plane`` or ``offset:0.0001``."""
        return self.self_hit

    def kernel(self, receivers: Receivers) -> LightSpaceKernel | None:
        """Return the filter's footprint, or ``None`` for a hard test. Not timed.

        A result is then measured against the truth filtered with it (:mod:`shadowbench.filtered_reference`).
        """
        return None

    def exact_on_map(self, receivers: Receivers) -> NDArray[np.float32] | None:
        """Return what the technique approximates: the mean of depth tests on its own map, weighted by its kernel.

        Shape [receiver_count], or ``None`` where there is no kernel or no depth map. Not timed, called after the last
        round.
        """
        return None

    def account(self, receivers: Receivers, index: int) -> Account | None:
        """Return how the visibility of one receiver came about: the technique's formula with its numbers.

        Not timed, called after ``shade()``, for a valid receiver. The account's visibility must be what ``shade()``
        wrote for it, to within the rounding that the account states. Look up with the functions that ``shade()`` looks
        up with, or the two will drift apart. Kernels for this alone are imported here, so that no run compiles them.

        Args:
            receivers: The visible samples, as ``shade()`` had them.
            index: Which one.

        Returns:
            ``None`` where the technique has nothing to tell.
        """
        return None

    def explain(self, receivers: Receivers, trace: Trace) -> None:
        """Report masks and pictures that a frame does not need. Not timed, called after the last round."""

    def close(self) -> None:
        """Release what Python would not."""
