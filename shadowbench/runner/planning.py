"""From experiments to a plan: every case with its parameters, keys, and what already stands in its way.

The runner itself imports no plugin: it asks a worker. What is the user's mistake (an unknown name, a value out of
range, a broken mesh file) is raised and nothing is measured; what a plugin does wrong (it cannot be imported, its
scene crashes) becomes the outcome of its own cases.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import replace
from types import TracebackType
from typing import Any, NamedTuple, Self

from shadowbench.errors import PluginError, SceneError, UsageError, did_you_mean
from shadowbench.experiment import Choice, Comparison, Experiment
from shadowbench.identity import available_cores, key_of, machine
from shadowbench.rows import Outcome
from shadowbench.runner.cases import Case, Obstacle, Plan, RunOptions, View
from shadowbench.runner.pool import Pool, Worker, default_memory_limit
from shadowbench.runner.protocol import CaseFailure

MOST_CASES = 20_000
"""More is a slip in a sweep, not a plan."""

MOST_RECEIVERS = 1 << 28
"""Of one picture, if every sample sees all its layers: what fits in some 40 GB."""

_USER_MISTAKES = {
    "describe_method": (),
    "resolve_method": ("ParameterError",),
    "resolve_scene": ("ParameterError",),
    "place_scene": ("ParameterError", "SceneError"),
}
"""Errors that end the planning; any other, and any crash, is an outcome."""


def plan(experiments: Sequence[Experiment], options: RunOptions) -> Plan:
    """Resolve experiments into cases.

    Scenes are made here, since only a scene knows its lights and cameras; they stay in the cache.

    Raises:
        UsageError: An unknown device, or experiments that cannot be run together.
        PluginError, ParameterError: An unknown method, scene or parameter, or a plugin file that cannot be loaded.
        SceneError: A scene that cannot be made, an unknown light or camera.
    """
    names = [experiment.name for experiment in experiments]
    for name in names:
        if names.count(name) > 1:
            raise UsageError(f"two experiments are called '{name}'; give one of them another name")
    case_count = sum(_least_case_count(c) for experiment in experiments for c in experiment.comparisons)
    if case_count > MOST_CASES:
        raise UsageError(f"the plan has {case_count} cases, more than {MOST_CASES}; sweep fewer values")
    limit = options.memory_limit_bytes or default_memory_limit()
    with Pool(options.plugin_files, limit) as pool, _Resolver(pool, options) as resolver:
        comparisons = [
            cases
            for experiment in experiments
            for comparison in experiment.comparisons
            for cases in resolver.cases_of(experiment, comparison)
        ]
    distinct = _without_repeats(comparisons)
    cases = [case for comparison in distinct for case in comparison]
    return Plan(
        experiments=tuple(experiments),
        options=options,
        comparisons=distinct,
        plan_key=key_of([[case.experiment, case.case_key] for case in cases]),
        notes=tuple(resolver.notes),
        method_defaults=resolver.method_defaults,
        warp=resolver.warp,
    )


def _without_repeats(comparisons: list[list[Case]]) -> tuple[tuple[Case, ...], ...]:
    """Keep the first of equal cases of an experiment, and number the comparisons that are left."""
    seen: set[tuple[str, str]] = set()
    kept: list[tuple[Case, ...]] = []
    for cases in comparisons:
        new = []
        for case in cases:
            if (case.experiment, case.case_key) not in seen:
                seen.add((case.experiment, case.case_key))
                new.append(replace(case, comparison=len(kept)))
        if new:
            kept.append(tuple(new))
    return tuple(kept)


def _least_case_count(comparison: Comparison) -> int:
    """Count the cases of a comparison; every method that may be found counts as one."""
    choices = [sum(_sweep_size(c) for c in those) for those in (comparison.scenes, comparison.methods)]
    others = (
        *(comparison.lights, comparison.cameras, comparison.sizes),
        *(comparison.pixel_samples, comparison.layers, comparison.moving, comparison.threads),
    )
    return math.prod(max(1, count) for count in (*choices, *map(len, others)))


def _sweep_size(choice: Choice) -> int:
    return math.prod(len(values) for values in choice.values.values())


class Picture(NamedTuple):
    """A picture's size [pixels], samples of every pixel, and most surfaces that a sample sees."""

    width: int
    height: int
    pixel_samples: int
    layers: int


def picture_of(view: View) -> Picture:
    """Return a view's picture."""
    return Picture(view.width, view.height, view.pixel_samples, view.layers)


class _Resolver:
    """Asks a worker, each thing once, and starts another if a plugin takes the worker down."""

    def __init__(self, pool: Pool, options: RunOptions) -> None:
        self._pool, self._options = pool, options
        self._worker: Worker | None = None
        self._answers: dict[str, Any] = {}
        self._machine = machine()
        self._threads = options.threads or (available_cores(),)
        self.notes: list[str] = []
        self.method_defaults: dict[str, dict[str, Any]] = {}
        self.warp: dict[str, Any] = {}

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._worker is not None and self._worker.is_alive:
            self._pool.park(self._worker)

    @property
    def _device(self) -> dict[str, Any]:
        """What :func:`shadowbench.runner.resolving.describe_device` says."""
        described: dict[str, Any] = self._require("describe_device", device=self._options.device)
        self.warp = described["settings"]
        return described

    def cases_of(self, experiment: Experiment, comparison: Comparison) -> list[list[Case]]:
        """Return the cases of each combination of scene, light, camera, size and threads."""
        methods = comparison.methods or tuple(Choice(name) for name in self._require("names", kind="method"))
        configurations = [(choice.name, values) for choice in methods for values in choice.expand()]
        scenes = [(choice.name, values) for choice in comparison.scenes for values in choice.expand()]
        threads = comparison.threads or self._threads
        if max(threads) > available_cores():
            note = f"{max(threads)} threads share {available_cores()} cores: their times say little"
            self.notes += [note] if note not in self.notes else []
        pictures = [
            Picture(*size, samples, layers)
            for size, samples, layers in itertools.product(
                comparison.sizes, comparison.pixel_samples, comparison.layers
            )
        ]
        for picture in pictures:
            if math.prod(picture) > MOST_RECEIVERS:
                raise UsageError(
                    f"{picture.width}x{picture.height} pixels of {picture.pixel_samples} samples and {picture.layers}"
                    f" layers are {math.prod(picture):,} receivers, more than {MOST_RECEIVERS:,}; ask for fewer"
                )
        dimensions = (scenes, comparison.lights, comparison.cameras, pictures, comparison.moving, threads)
        grouped = []
        for scene, light, camera, picture, moving, thread_count in itertools.product(*dimensions):
            view, obstacle = self._view(*scene, light, camera, picture, moving)
            grouped.append(
                [
                    self._case(experiment, view, obstacle, method, values, thread_count)
                    for method, values in configurations
                ]
            )
        return grouped

    def _view(
        self,
        name: str,
        values: dict[str, Any],
        light: str | None,
        camera: str | None,
        picture: Picture,
        moving: str,
    ) -> tuple[tuple[View, dict[str, Any]], Obstacle | None]:
        """Return a view, the part of its scene's parameters that keys hold, and what keeps it from being drawn."""
        self._must_exist("scene", name)
        scene, obstacle = self._attempt("resolve_scene", name=name, values=values)
        world = None
        if scene is None:
            scene = {"name": name, "parameters": values, "portable_parameters": values, "key": ""}
        else:
            world, obstacle = self._attempt("place_scene", cache=str(self._options.cache), scene=scene)
        if world is None:
            world = {"content": "", "triangles": None, "lights": [light or ""], "cameras": [camera or ""], "notes": []}
        view = View(
            scene=scene["name"],
            scene_parameters=scene["parameters"],
            world_key=scene["key"],
            content=world["content"],
            triangles=world["triangles"],
            light=_one_of(world["lights"], light, "light", scene["name"]),
            camera=_one_of(world["cameras"], camera, "camera", scene["name"]),
            width=picture.width,
            height=picture.height,
            pixel_samples=picture.pixel_samples,
            layers=picture.layers,
            moving=moving,
            notes=tuple(world["notes"]),
        )
        return (view, scene["portable_parameters"]), obstacle

    def _case(
        self,
        experiment: Experiment,
        view_and_parameters: tuple[View, dict[str, Any]],
        obstacle: Obstacle | None,
        method: str,
        values: dict[str, Any],
        threads: int,
    ) -> Case:
        view, scene_parameters = view_and_parameters
        self._must_exist("method", method)
        described, broken = self._attempt("describe_method", name=method)
        if described is None:
            described = {"title": method, "deterministic": True, "code": "", "libraries": {}}
            parameters = values
        else:
            parameters, broken = self._attempt("resolve_method", name=method, values=values)
            broken = broken or self._inapplicable(described)
            self.method_defaults[method] = described["defaults"]
        quality_key = key_of(
            {
                "scene": [view.scene, scene_parameters, view.content or view.world_key],
                "view": [view.light, view.camera, *picture_of(view), view.moving],
                "method": [method, parameters, described["code"]],
                "platform": [self._device["kind"], self._device["warp"], described["libraries"]],
                "truth": [self._device["truth"], self._device["measures"]],
            }
        )
        return Case(
            experiment=experiment.name,
            comparison=0,
            view=view,
            method=method,
            method_title=described["title"],
            method_parameters=values if parameters is None else parameters,
            deterministic=described["deterministic"],
            device=self._options.device,
            threads=threads,
            quality_key=quality_key,
            case_key=key_of([quality_key, self._options.device, threads, self._machine]),
            libraries=described["libraries"],
            obstacle=broken or obstacle,
        )

    def _must_exist(self, kind: str, name: str) -> None:
        if kind == "scene" and Choice(name).is_mesh_file:
            return
        names = self._require("names", kind=kind)
        if name not in names:
            raise PluginError(f"no {kind} is called '{name}'; {did_you_mean(name, names, noun=kind)}")

    def _inapplicable(self, described: dict[str, Any]) -> Obstacle | None:
        if described["unavailable"] is not None:
            return Obstacle(Outcome.SKIPPED, described["unavailable"])
        if self._device["kind"] not in described["devices"]:
            kinds = ", ".join(described["devices"])
            return Obstacle(Outcome.SKIPPED, f"runs on {kinds}, not on {self._options.device}")
        return None

    def _attempt(self, call: str, **arguments: Any) -> tuple[Any, Obstacle | None]:
        """Ask; where it is the plugin's fault that there is no answer, return the outcome of its cases instead.

        Raises:
            ParameterError, SceneError: It is the user's fault.
        """
        try:
            return self._ask(call, **arguments), None
        except CaseFailure as failure:
            if failure.error_class in _USER_MISTAKES[call]:
                raise failure.as_user_error() or failure from None
            if call in ("resolve_scene", "place_scene"):
                scene = arguments["name"] if call == "resolve_scene" else arguments["scene"]["name"]
                return None, Obstacle(Outcome.ERROR, f"scene '{scene}': {failure.reason}", failure.stderr_tail)
            return None, Obstacle(failure.outcome, failure.reason, failure.stderr_tail)

    def _require(self, call: str, **arguments: Any) -> Any:
        """Ask for what the whole plan needs.

        Raises:
            ShadowbenchError: There is no answer.
        """
        try:
            return self._ask(call, **arguments)
        except CaseFailure as failure:
            raise failure.as_user_error() or PluginError(f"plugins cannot be loaded: {failure.reason}") from None

    def _ask(self, call: str, **arguments: Any) -> Any:
        question = key_of([call, arguments])
        if question not in self._answers:
            try:
                self._answers[question] = self._asked(call, arguments)
            except CaseFailure as failure:
                self._answers[question] = failure
        answer = self._answers[question]
        if isinstance(answer, CaseFailure):
            raise answer
        return answer

    def _asked(self, call: str, arguments: dict[str, Any]) -> Any:
        """Ask a worker, and another one if somebody kills the first."""
        for _ in range(2):
            if self._worker is None or self._worker.has_ended():
                self._worker = self._pool.take(max(self._threads))
            try:
                return self._worker.ask(call, arguments, self._options.timeout_s)
            except CaseFailure as failure:
                latest = failure
                if not failure.is_from_outside:
                    break
        raise latest


def _one_of(names: list[str], wanted: str | None, what: str, scene: str) -> str:
    """Return the name asked for, or the first."""
    if wanted is None:
        return names[0]
    if wanted not in names:
        raise SceneError(f"scene '{scene}' has no {what} '{wanted}'; {did_you_mean(wanted, names, noun=what)}")
    return wanted
