"""Opening a view and a case again: the world, its receivers and its truth, and what a method makes of them.

A case's parameters come from its row; everything else is made by the code of today, so that a row's numbers and what is
seen may differ where code changed: :attr:`OpenCase.notes` says so.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from shadowbench.choices import Choice
from shadowbench.device.launch import Context
from shadowbench.errors import PluginError, SceneError, ShadowbenchError, UsageError, did_you_mean
from shadowbench.experiment import Comparison, Experiment
from shadowbench.identity import available_cores, visibility_digest
from shadowbench.inspection import kept_visibility
from shadowbench.light_space import camera_frame
from shadowbench.method import Changes, Method, Trace
from shadowbench.method import View as MethodView
from shadowbench.metrics import Measurement, measure
from shadowbench.parameters import parse_parameters
from shadowbench.plugins import Registry
from shadowbench.rows import Outcome, ResultRow
from shadowbench.runner.cache import Cache
from shadowbench.runner.cases import RunOptions, View
from shadowbench.runner.planning import plan
from shadowbench.runner.preparation import place_scene, prepare, world_name
from shadowbench.runner.resolving import MESH_FILE, resolve_scene
from shadowbench.store import Store

if TYPE_CHECKING:
    from shadowbench.receivers import Receivers
    from shadowbench.reference import Reference
    from shadowbench.scene import Camera, Light
    from shadowbench.world import World


@dataclass(frozen=True, eq=False)
class OpenView:
    """One scene under one light, seen by one camera, with its truth.

    Attributes:
        view: Names and sizes.
        world: The placed scene.
        light, camera: In the world.
        receivers: The visible samples.
        reference: Their hard truth.
    """

    view: View
    world: World
    light: Light
    camera: Camera
    receivers: Receivers
    reference: Reference


@dataclass(frozen=True, eq=False)
class OpenCase:
    """A view and what a method made of it.

    Attributes:
        row: The case's row.
        seen: The view.
        method: After ``build()``, ``shade()`` and ``explain()``; ``None`` for a result that was made elsewhere.
        visibility: What it wrote, 0 outside the light's field.
        digest: Of the bits that it wrote, as in rows.
        trace: What it reported.
        measured: Its failures.
        context: Where it ran.
        notes: What the user should know.
    """

    row: ResultRow
    seen: OpenView
    method: Method | None
    visibility: NDArray[np.float32]
    digest: str
    trace: Trace
    measured: Measurement
    context: Context
    notes: tuple[str, ...]


def open_view(
    registry: Registry,
    cache: Path,
    scene: Choice,
    *,
    light: str | None,
    camera: str | None,
    size: tuple[int, int],
    pixel_samples: int = 1,
    layers: int = 1,
) -> OpenView:
    """Make and place a scene, render its receivers and decide them; all three are kept in the cache.

    Args:
        registry: The plugins.
        cache: Its folder.
        scene: With one value a parameter.
        light, camera: Names; ``None`` for the scene's first.
        size: Of the picture [pixels].
        pixel_samples: Samples of every pixel.
        layers: Most surfaces that a sample sees.

    Raises:
        UsageError: A parameter is swept.
        PluginError, SceneError: The scene cannot be found or made, or has no such light or camera.
    """
    values = list(scene.expand())
    if len(values) != 1:
        raise UsageError(f"one scene at a time: '{scene}' sweeps {len(values)}")
    with plugin_errors(f"scene '{scene.name}'"):
        resolved = resolve_scene(registry, scene.name, values[0])
        described = place_scene(registry, cache, resolved)
    view = View(
        scene=resolved["name"],
        scene_parameters=resolved["parameters"],
        world_key=resolved["key"],
        content=described["content"],
        triangles=described["triangles"],
        light=_one_of(described["lights"], light, "light", resolved["name"]),
        camera=_one_of(described["cameras"], camera, "camera", resolved["name"]),
        width=size[0],
        height=size[1],
        pixel_samples=pixel_samples,
        layers=layers,
        notes=tuple(described["notes"]),
    )
    entries = prepare(cache, asdict(view), available_cores(), with_reference=True)
    kept = Cache(cache)
    world: World = kept.open(world_name(view.world_key))
    return OpenView(
        view,
        world,
        world.lights[view.light],
        world.cameras[view.camera],
        kept.open(entries["receivers"]),
        kept.open(entries["reference"]),
    )


def view_of_row(registry: Registry, cache: Path, row: ResultRow) -> OpenView:
    """Open the view of a case's row; see :func:`open_view`."""
    return open_view(
        registry,
        cache,
        _scene_of(row),
        light=row.light,
        camera=row.camera,
        size=(row.width, row.height),
        pixel_samples=row.pixel_samples,
        layers=row.layers,
    )


def open_case(
    row: ResultRow, results: Path, plugin_files: tuple[Path, ...] = (), *, tell_changes: bool = True
) -> OpenCase:
    """Run a case's method once more, untimed.

    Args:
        row: The case's.
        results: The results folder, whose cache is used.
        plugin_files: Files that its method or scene comes from.
        tell_changes: Find out for the notes whether code or result are still the row's.

    Raises:
        UsageError: The case ended otherwise than ok or invalid, or was made elsewhere and is not kept, so that there
            is no result to look at.
        PluginError, SceneError: Its method or scene cannot be found, or fails.
    """
    if row.outcome not in (Outcome.OK, Outcome.INVALID):
        raise UsageError(f"case {row.case_key} ended as {row.outcome.value}, so there is nothing to view: {row.reason}")
    options = RunOptions(results=results, device=row.device, threads=(row.threads,), plugin_files=plugin_files)
    registry = Registry(plugin_files)
    seen = view_of_row(registry, options.cache, row)
    if row.method_title.endswith("(external)"):
        return _opened_external(row, seen, results)
    context = Context(row.device, min(row.threads, available_cores()))
    with plugin_errors(f"method '{row.method}'"):
        cls = registry.method(row.method)
        reason = cls.available()
        if reason is None:
            owner = f"method '{row.method}'"
            method = cls(parse_parameters(cls.Parameters, row.method_parameters, owner=owner), context)
            reason = method.supports(seen.world, seen.light)
        if reason is not None:
            raise PluginError(f"method '{row.method}' does not apply here: {reason}")
        visibility, digest, trace = _frame(method, seen, context)
    measured = measure(seen.world, seen.receivers, seen.reference, visibility, trace.masks)
    notes = tuple(_changes(row, options, measured.columns)) if tell_changes else ()
    return OpenCase(row, seen, method, visibility, digest, trace, measured, context, notes)


def _opened_external(row: ResultRow, seen: OpenView, results: Path) -> OpenCase:
    """Open a result that was made elsewhere: its visibility as it was scored, and nothing of how it came about."""
    file = row.artifacts.get(kept_visibility.ARTIFACT)
    if file is None:
        raise UsageError(
            f"case {row.case_key} was made elsewhere, and only its measures and pictures are kept, not its visibility; "
            "score it again to look into it"
        )
    is_opaque = seen.world.casters.is_opaque
    shape = (seen.receivers.count,) if is_opaque else (seen.receivers.count, 3)
    with Store.open(results) as store:
        visibility = kept_visibility.read(store.artifact(file), shape)
    context = Context()
    measured = measure(seen.world, seen.receivers, seen.reference, visibility, {})
    notes = [
        "made elsewhere: what it stores, its formula, and the filter that it was scored against are not known",
        *_differing(row, measured.columns),
    ]
    return OpenCase(row, seen, None, visibility, row.visibility_digest, Trace(context), measured, context, tuple(notes))


@contextmanager
def plugin_errors(owner: str) -> Iterator[None]:
    """Turn whatever a plugin raises into an error of one line.

    Raises:
        PluginError: Something else than a :class:`ShadowbenchError` was raised.
    """
    try:
        yield
    except ShadowbenchError:
        raise
    except Exception as error:
        reason = next(iter(str(error).splitlines()), "")
        raise PluginError(f"{owner} failed: {type(error).__name__}: {reason}") from error


def _frame(method: Method, seen: OpenView, context: Context) -> tuple[NDArray[np.float32], str, Trace]:
    """Build, shade and explain once; return the visibility, the digest of its bits as written, and the trace."""
    world, receivers = seen.world, seen.receivers
    size = receivers.width, receivers.height
    view = MethodView(seen.camera, *size, camera_frame(seen.camera, *size, world))
    shape = (receivers.count,) if world.casters.is_opaque else (receivers.count, 3)
    unwritten = np.full(shape, np.nan, np.float32)
    visibility: wp.array[Any] = wp.array(unwritten, dtype=wp.float32, device=context.device)
    everything = frozenset(range(len(world.casters.instances)))
    trace = Trace(context)
    method.build(world.casters, seen.light, view, Changes(light=True, instances=everything, view=True), trace)
    method.shade(receivers, visibility, trace)
    method.explain(receivers, trace)
    written: NDArray[np.float32] = visibility.numpy().copy()
    digest = visibility_digest(written, receivers.valid)
    written[~seen.reference.in_field] = 0.0  # as the harness does
    return written, digest, trace


def _changes(row: ResultRow, options: RunOptions, columns: Mapping[str, Any]) -> Iterator[str]:
    """Yield what is not as it was when the row was made."""
    same = Comparison(
        scenes=(_scene_of(row),),
        methods=(Choice(row.method, {name: (value,) for name, value in row.method_parameters.items()}),),
        lights=(row.light,),
        cameras=(row.camera,),
        sizes=((row.width, row.height),),
        pixel_samples=(row.pixel_samples,),
        layers=(row.layers,),
        threads=(row.threads,),
    )
    planned = plan([Experiment(name=row.experiment, title="", comparisons=(same,))], options)
    if planned.cases[0].quality_key != row.quality_key:
        yield (
            "the code, the scene or a library has changed since this row was made: what is shown is made with today's"
        )
    yield from _differing(row, columns)


def _differing(row: ResultRow, columns: Mapping[str, Any]) -> Iterator[str]:
    """Yield which counts are not the row's."""
    names = ("failure_count", "false_lit_count", "false_shadow_count")
    differing = [
        f"{name} was {getattr(row, name)}, is {columns[name]}" for name in names if getattr(row, name) != columns[name]
    ]
    if differing and row.outcome is Outcome.OK:
        yield f"the result differs from the row's: {'; '.join(differing)}"


def _scene_of(row: ResultRow) -> Choice:
    """Return the choice that names a row's scene; a mesh file's is its path."""
    values = dict(row.scene_parameters)
    if "path" in values and Choice(row.scene).is_mesh_file:
        path = str(values.pop("path"))
        name = path if Choice(path).is_mesh_file else MESH_FILE
        return Choice(name, {key: (value,) for key, value in values.items()})
    return Choice(row.scene, {key: (value,) for key, value in values.items()})


def _one_of(names: list[str], wanted: str | None, what: str, scene: str) -> str:
    """Return the name asked for, or the first."""
    if wanted is None:
        return names[0]
    if wanted not in names:
        raise SceneError(f"scene '{scene}' has no {what} '{wanted}'; {did_you_mean(wanted, names, noun=what)}")
    return wanted
