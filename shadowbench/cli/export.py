"""``shadowbench export-scene`` and ``shadowbench score``: a view out to other programs, their visibility in."""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from shadowbench.cli import completion
from shadowbench.cli.console import complain, reserved_stdout
from shadowbench.cli.options import DEFAULT_RESULTS, PluginOption, ResultsOption, open_store
from shadowbench.cli.views import (
    DEFAULT_SIZE,
    CameraOption,
    LayersOption,
    LightOption,
    PixelSamplesOption,
    SizeOption,
    open_named_view,
    quieten_warp,
)
from shadowbench.errors import UsageError

if TYPE_CHECKING:
    from shadowbench.plugins import Registry
    from shadowbench.rows import ResultRow

_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._+-]{0,63}")


def export_scene(
    context: typer.Context,
    scene: Annotated[
        str,
        typer.Argument(
            metavar="SCENE",
            help="NAME[:key=v,...] or a mesh file.",
            autocompletion=completion.scenes,
            show_default=False,
        ),
    ],
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="DIR", help="The folder to write to.", show_default=False)
    ],
    light: LightOption = None,
    camera: CameraOption = None,
    size: SizeOption = DEFAULT_SIZE,
    pixel_samples: PixelSamplesOption = 1,
    layers: LayersOption = 1,
    plugin: PluginOption = None,
    results: ResultsOption = DEFAULT_RESULTS,
) -> None:
    """Write a scene, its light, camera and receivers for another program (glTF, NPZ, JSON)."""
    del context
    quieten_warp()
    with reserved_stdout() as stream:
        from shadowbench.inspection.exporting import export
        from shadowbench.plugins import Registry

        registry = Registry(tuple(plugin or ()))
        seen = open_named_view(
            registry,
            results,
            scene,
            light=light,
            camera=camera,
            size=size,
            pixel_samples=pixel_samples,
            layers=layers,
        )
        for file in export(seen, output):
            stream.write(f"{file}\n")


def score(
    context: typer.Context,
    visibility: Annotated[
        Path,
        typer.Argument(
            metavar="VISIBILITY",
            help=".npy, .exr or .png, linear, 1 lit to 0 shadowed: a value per pixel or per receiver.",
            show_default=False,
        ),
    ],
    case: Annotated[
        str | None,
        typer.Option("--case", metavar="CASE", help="Of this case's view, and aiming at what it aims at."),
    ] = None,
    scene: Annotated[
        str | None,
        typer.Option("--scene", metavar="NAME[:key=v,...]|MESHFILE", help="Instead of --case."),
    ] = None,
    name: Annotated[
        str | None, typer.Option("--name", metavar="NAME", help="What made it.", show_default=False)
    ] = None,
    light: LightOption = None,
    camera: CameraOption = None,
    size: SizeOption = DEFAULT_SIZE,
    pixel_samples: PixelSamplesOption = 1,
    layers: LayersOption = 1,
    hard: Annotated[
        bool, typer.Option("--hard", help="With --case: aim at the hard truth, whatever the case aims at.")
    ] = False,
    append: Annotated[
        bool, typer.Option("--append", help="With --case: put the row beside it, not into a new run.")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="The result row on standard output.")] = False,
    plugin: PluginOption = None,
    results: ResultsOption = DEFAULT_RESULTS,
) -> None:
    """Measure a visibility made elsewhere, an engine's or a path tracer's, like any technique's."""
    if (case is None) == (scene is None):
        raise UsageError("give either --case CASE or --scene SCENE: which view the visibility is of")
    if case is None and (append or hard):
        raise UsageError("--append and --hard need --case")
    chosen = name or visibility.stem
    if not _NAME.fullmatch(chosen):
        raise UsageError(f"--name: letters, digits and . _ + - name what made it, 64 at most, not '{chosen}'")
    beside = None
    if case is not None:
        from shadowbench.inspection.finding import find_case

        with open_store(results) as store:
            beside = find_case(store, case)
    quieten_warp()
    with reserved_stdout() as stream:
        from shadowbench.plugins import Registry

        registry = Registry(tuple(plugin or ()))
        if chosen in registry.names("method"):
            raise UsageError(f"--name: '{chosen}' is a method here; call what made the file otherwise")
        options = (light, camera, size, pixel_samples, layers)
        row = _score(
            registry, results, visibility, chosen, beside, scene, options, hard=hard, append=append, argv=context.obj
        )
        if as_json:
            stream.write(row.model_dump_json() + "\n")
            return
    for warning in row.warnings:
        complain(f"note: {warning}")
    _print_table(results, row)


def _score(
    registry: Registry,
    results: Path,
    file: Path,
    name: str,
    beside: ResultRow | None,
    scene: str | None,
    options: tuple[str | None, str | None, str, int, int],
    *,
    hard: bool,
    append: bool,
    argv: tuple[str, ...] | None,
) -> ResultRow:
    from shadowbench.inspection import scoring
    from shadowbench.inspection.opening import plugin_errors, view_of_row
    from shadowbench.inspection.visibility_files import read_visibility
    from shadowbench.runner.cases import RunOptions
    from shadowbench.store import Store

    kernel = None
    if beside is not None:
        seen = view_of_row(registry, RunOptions(results=results).cache, beside)
        if not hard:
            with plugin_errors(f"method '{beside.method}': kernel() (--hard goes without)"):
                kernel = scoring.kernel_of_case(registry, beside, seen)
    else:
        light, camera, size, pixel_samples, layers = options
        assert scene is not None
        seen = open_named_view(
            registry,
            results,
            scene,
            light=light,
            camera=camera,
            size=size,
            pixel_samples=pixel_samples,
            layers=layers,
        )
    channels = 1 if seen.world.casters.is_opaque else 3
    values = read_visibility(file, seen.receivers, channels=channels)
    with Store.open(results) as store:
        return scoring.score(
            store,
            seen,
            values,
            name,
            source=file.name,
            kernel=kernel,
            beside=beside if append else None,
            argv=tuple(argv or ()),
        )


def _print_table(results: Path, row: ResultRow) -> None:
    from shadowbench import tables
    from shadowbench.cli.console import put

    with open_store(results) as store:
        record = store.find_run(row.run_id)
        rows = store.rows(row.run_id, row.experiment)
    written = tables.render(tables.make(rows, run=record), "rich")
    if isinstance(written, str):
        sys.stdout.write(written)
    else:
        put(written)
    print(f"case {row.case_key} of run {row.run_id}")
