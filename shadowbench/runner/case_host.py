"""One case in its worker: load, warm up, timed rounds, and what is measured when they are over.

The clock runs over ``build()`` and ``shade()`` and nothing else. Before each, the visibility is filled with NaN; after
each, the result is held to the contract of :class:`shadowbench.method.Method` and to the bits of the first one.
"""

from __future__ import annotations

import gc
import math
import os
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from shadowbench.contract import filter_breaches, visibility_breaches
from shadowbench.device.launch import Context, synchronize
from shadowbench.errors import InvalidResultError
from shadowbench.identity import visibility_digest
from shadowbench.method import Method, Trace, View
from shadowbench.metrics import measure, measure_likeness
from shadowbench.motion import Moment, everything_changed, moment_before
from shadowbench.parameters import parse_parameters
from shadowbench.pictures import case_pictures, png
from shadowbench.runner.cache import Cache
from shadowbench.runner.kernels import load_kernels
from shadowbench.runner.peak_memory import forget_peak, peak_bytes
from shadowbench.runner.sampling import WARM_BELOW_MS, WarmUp, repeats_for

if TYPE_CHECKING:
    from shadowbench.filtered_reference import FilteredReference
    from shadowbench.plugins import Registry
    from shadowbench.receivers import Receivers
    from shadowbench.reference import Reference
    from shadowbench.scene import Light
    from shadowbench.world import World


class CaseHost:
    """Holds one method object and all it needs.

    Args:
        registry: The plugins.
        tell_phase: Told what comes next.
    """

    def __init__(self, registry: Registry, tell_phase: Callable[[str], None]) -> None:
        self._registry = registry
        self._tell_phase = tell_phase
        self._method: Method | None = None
        self._first: NDArray[np.float32] | None = None
        self._first_digest = ""
        self._changed_count = 0
        self._warnings: list[str] = []
        self._last_ms = math.inf
        self._repeats = 1, 1

    def load(
        self,
        *,
        cache: str,
        entries: dict[str, str],
        light: str,
        camera: str,
        moving: str,
        method: str,
        parameters: dict[str, Any],
        device: str,
        threads: int,
    ) -> dict[str, Any]:
        """Open the scene, make the method, compile and load its kernels.

        Args:
            cache: The cache's folder.
            entries: Names of ``world`` and ``receivers`` in it.
            light, camera: Names in the world.
            moving: What moves between two frames, of :data:`shadowbench.choices.MOVING`.
            method: Its name.
            parameters: All of its parameters.
            device, threads: Where to run.

        Returns:
            ``skipped`` with a reason, or ``kernels``: how long each Warp module took to load [ms].
        """
        forget_peak()
        self._cache = Cache(Path(cache))
        self._world: World = self._cache.open(entries["world"])
        self._receivers: Receivers = self._cache.open(entries["receivers"])
        self._light: Light = self._world.lights[light]
        self._context = Context(device, threads)
        cls = self._registry.method(method)
        reason = cls.available()
        if reason is None:
            chosen = parse_parameters(cls.Parameters, parameters, owner=f"method '{method}'")
            self._method = cls(chosen, self._context)
            reason = self._method.supports(self._world, self._light)
        if reason is not None:
            return {"skipped": reason}
        self._now = Moment(self._world, self._light, self._world.cameras[camera])
        self._before, self._changes = moment_before(self._now, moving)
        shape = (self._receivers.count,) if self._world.casters.is_opaque else (self._receivers.count, 3)
        unwritten = np.full(shape, np.nan, dtype=np.float32)
        self._unwritten: wp.array[Any] = wp.array(unwritten, dtype=wp.float32, device=device)
        self._visibility: wp.array[Any] = wp.array(unwritten, dtype=wp.float32, device=device)
        self._tell_phase("compiling kernels")
        return {"kernels": load_kernels([cls.__module__], device)}

    def warm_up(self, repeats: Sequence[int] | None = None) -> dict[str, Any]:
        """Run frames outside the clock until they are steady, hold the results to the contract, and calibrate.

        Args:
            repeats: How often build and shade are repeated within a sample, where another process has found out.

        Returns:
            ``frames``: how many there were; ``repeats`` of build and of shade; ``visibility_digest`` and ``counters``,
            which are the same in every process.

        Raises:
            InvalidResultError: The result breaks the contract.
        """
        warm_up = WarmUp()
        while not warm_up.is_over:
            durations = self._frame(tell=warm_up.frames == 0)
            warm_up.add(sum(durations))
        build, shade = map(repeats_for, durations) if repeats is None else repeats
        moves = self._before is not self._now  # and has moved once one build is over
        self._repeats = 1 if moves else build, shade
        gc.collect()
        return {
            "frames": warm_up.frames,
            "repeats": self._repeats,
            "visibility_digest": self._first_digest,
            "counters": self._first_counters,
        }

    def round(self) -> dict[str, Any]:
        """Take one sample.

        Returns:
            ``build`` and ``shade`` [ms], ``stages``; all of them of one frame.

        Raises:
            InvalidResultError: The result breaks the contract, or differs from the first one.
        """
        if self._last_ms < WARM_BELOW_MS:
            self._frame()
        build_ms, shade_ms = self._frame(self._repeats)
        return {"build": build_ms, "shade": shade_ms, "stages": self._stages}

    def peak_bytes(self) -> int:
        """Return the largest resident size so far [bytes]."""
        return peak_bytes()

    def kernel(self) -> dict[str, Any] | None:
        """Return the kernel that the reference must be filtered with, ``None`` for a hard test.

        Raises:
            InvalidResultError: What the method tells of its filter breaks the contract.
        """
        assert self._method is not None
        self._peak = peak_bytes()
        kernel = self._method.kernel(self._receivers)
        self._on_map = self._method.exact_on_map(self._receivers)
        for breach in filter_breaches(kernel, self._on_map, self._receivers):
            raise InvalidResultError(breach)
        self._is_filtering = kernel is not None
        return None if kernel is None else asdict(kernel)

    def summary(self) -> dict[str, Any]:
        """Return what the rounds gave, without comparing it with the truth; an earlier result is known by it."""
        assert self._method is not None
        return {
            "counters": self._trace.counters,
            "kept": self._trace.bytes_by_name(),
            "self_hit": self._method.self_hit_rule(),
            "view_dependent": self._method.is_view_dependent(),
            "visibility_digest": self._first_digest,
            "changed_count": None if self._method.deterministic else self._changed_count,
            "peak_rss_bytes": peak_bytes(),
            "warnings": self._warnings,
        }

    def measure(self, pictures: Path, reference: str, filtered: str | None) -> dict[str, Any]:
        """Compare the result with the reference and draw it; :meth:`kernel` comes first.

        Args:
            pictures: A folder to write the pictures to.
            reference: Name of the reference in the cache.
            filtered: Name of the filtered reference in the cache; ``None`` for a hard test, or if it cannot be made.

        Raises:
            InvalidResultError: A mask or a heat map has not one value per receiver.
        """
        assert self._method is not None
        self._reference: Reference = self._cache.open(reference)
        trace = self._trace
        self._tell_phase("explain")
        self._method.explain(self._receivers, trace)
        for kind, arrays in (("mask", trace.masks), ("heat map", trace.heats)):
            for name, values in arrays.items():
                if values.shape != (self._receivers.count,):
                    raise InvalidResultError(
                        f"{kind} '{name}' has shape {values.shape}, "
                        f"not one value for each of {self._receivers.count} receivers"
                    )
        self._tell_phase("measure")
        visibility = self._visibility.numpy()
        visibility[~self._reference.in_field] = 0.0  # the light does not reach there, whatever the method wrote
        found = measure(self._world, self._receivers, self._reference, visibility, trace.masks)
        aim: FilteredReference | None = None if filtered is None else self._cache.open(filtered)
        columns = found.columns | self._likeness(aim)
        drawn = case_pictures(
            self._world,
            self._light,
            self._receivers,
            self._reference,
            visibility,
            found.masks | trace.masks,
            trace.heats,
            filtered=aim,
        )
        drawn |= {f"picture-{name}": png(image) for name, image in trace.pictures.items()}
        files = {}
        for index, (name, content) in enumerate(drawn.items()):
            file = pictures / f"{os.getpid()}-{index}.png"
            file.write_bytes(content)
            files[name] = str(file)
        if self._changed_count:
            self._warnings.append(f"up to {self._changed_count} receivers changed between repeats")
        return self.summary() | {
            "columns": {name: _plain(value) for name, value in columns.items()},
            "pictures": files,
            "peak_rss_bytes": self._peak,
        }

    def _likeness(self, filtered: FilteredReference | None) -> dict[str, Any]:
        """Return the measures against the reference that the method aims at."""
        if self._is_filtering and filtered is None:
            self._warnings.append("the filtered reference could not be made: measures against it are empty")
            return {}
        visibility = self._visibility.numpy()
        return measure_likeness(self._receivers, self._reference, visibility, filtered=filtered, on_map=self._on_map)

    def close(self) -> None:
        """Let go of the method and its memory."""
        if self._method is not None:
            self._method.close()

    def _frame(self, repeats: tuple[int, int] = (1, 1), *, tell: bool = False) -> tuple[float, float]:
        """Build and shade, each as often as ``repeats`` says; return the durations of one of each [ms]."""
        assert self._method is not None
        if self._before is not self._now:
            self._step_back(tell=tell)
        wp.copy(self._visibility, self._unwritten)
        synchronize(self._context)
        # a trace for every repeat, made beforehand; the last of build() is the first of shade()
        builds, shades = ([Trace(self._context) for _ in range(count)] for count in repeats)
        trace = self._trace = shades[0] = builds[-1]
        casters, view = self._now.world.casters, self._view(self._now)
        with _without_collection():
            if tell:
                self._tell_phase("build")
            build_begin = time.perf_counter()
            for build_trace in builds:
                self._method.build(casters, self._now.light, view, self._changes, build_trace)
            synchronize(self._context)
            build_end = time.perf_counter()
            built_stages = dict(trace.stages)
            if tell:
                self._tell_phase("shade")
            shade_begin = time.perf_counter()
            for shade_trace in shades:
                self._method.shade(self._receivers, self._visibility, shade_trace)
            synchronize(self._context)
            shade_end = time.perf_counter()
        self._stages = _stages_of_one_frame(builds, shades, built_stages)
        build_ms = (build_end - build_begin) * 1.0e3 / len(builds)
        shade_ms = (shade_end - shade_begin) * 1.0e3 / len(shades)
        self._last_ms = build_ms + shade_ms
        self._check(trace)
        return build_ms, shade_ms

    def _step_back(self, *, tell: bool) -> None:
        """Have the method build for the frame before, so that what moves has moved when the clock starts."""
        assert self._method is not None
        if tell:
            self._tell_phase("build before anything moves")
        before = self._before
        changes = everything_changed(before.world) if self._first is None else self._changes
        self._method.build(before.world.casters, before.light, self._view(before), changes, Trace(self._context))

    def _view(self, moment: Moment) -> View:
        return moment.view(self._receivers.width, self._receivers.height)

    def _check(self, trace: Trace) -> None:
        """Hold a result to the contract and to the first result."""
        assert self._method is not None
        visibility = self._visibility.numpy()
        valid = self._receivers.valid
        digest = visibility_digest(visibility, valid)
        if self._first is None:
            for breach in visibility_breaches(visibility, self._receivers):
                raise InvalidResultError(breach)
            self._first, self._first_digest = visibility.copy(), digest
            self._first_counters = dict(trace.counters)
            return
        if digest != self._first_digest:
            differs = (visibility != self._first).reshape(len(valid), -1).any(axis=1) & valid
            count = int(differs.sum())
            if self._method.deterministic:
                raise InvalidResultError(f"{count} of {int(valid.sum())} receivers differ between two repeats")
            for breach in visibility_breaches(visibility, self._receivers):
                raise InvalidResultError(breach)
            self._changed_count = max(self._changed_count, count)
        if self._method.deterministic and trace.counters != self._first_counters:
            raise InvalidResultError(_counter_difference(self._first_counters, trace.counters))


def _stages_of_one_frame(
    builds: Sequence[Trace], shades: Sequence[Trace], built_stages: dict[str, float]
) -> dict[str, float]:
    """Return the durations of stages over all repeats, as those of one frame [ms].

    Args:
        builds, shades: The traces of the repeats; the last of the one is the first of the other.
        built_stages: What that one held between the two.
    """
    found: dict[str, float] = {}
    for stages in (*(trace.stages for trace in builds[:-1]), built_stages):
        for name, duration in stages.items():
            found[name] = found.get(name, 0.0) + duration / len(builds)
    for trace in shades:
        before = built_stages if trace is shades[0] else {}
        for name, duration in trace.stages.items():
            found[name] = found.get(name, 0.0) + (duration - before.get(name, 0.0)) / len(shades)
    return found


def _counter_difference(first: dict[str, int], later: dict[str, int]) -> str:
    for name in sorted(first.keys() | later.keys()):
        if first.get(name) != later.get(name):
            return f"counter '{name}' is {first.get(name)} in one repeat and {later.get(name)} in another"
    return "counters differ between repeats"


@contextmanager
def _without_collection() -> Iterator[None]:
    """Keep Python's garbage collector from starting while the clock runs."""
    gc.disable()
    try:
        yield
    finally:
        gc.enable()


def _plain(value: Any) -> Any:
    """Return a column's value as JSON has it; what is not finite does not apply."""
    value = value.item() if isinstance(value, np.generic) else value
    return None if isinstance(value, float) and not math.isfinite(value) else value
