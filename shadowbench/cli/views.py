"""What commands that need a scene, a light and a camera share: their options, and opening the view."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from shadowbench.cli import completion

if TYPE_CHECKING:
    from shadowbench.inspection.opening import OpenView
    from shadowbench.plugins import Registry

DEFAULT_SIZE = "1024x768"

LightOption = Annotated[
    str | None,
    typer.Option("--light", metavar="NAME", help="One of the scene's lights; the first if not given."),
]

CameraOption = Annotated[
    str | None,
    typer.Option("--camera", metavar="NAME", help="One of the scene's cameras; the first if not given."),
]

SizeOption = Annotated[str, typer.Option("--size", metavar="WIDTHxHEIGHT", help="The picture's size.")]

PixelSamplesOption = Annotated[
    int, typer.Option("--pixel-samples", metavar="N", min=1, max=256, help="Samples of every pixel.")
]

LayersOption = Annotated[
    int, typer.Option("--layers", metavar="N", min=1, max=64, help="Most surfaces a sample sees through others.")
]

CaseArgument = Annotated[
    str,
    typer.Argument(
        metavar="CASE",
        help="A case's key or the beginning of it, or RUN:CASE.",
        autocompletion=completion.cases,
        show_default=False,
    ),
]


def quieten_warp() -> None:
    """Keep Warp from telling which kernels it loads and which devices it lacks."""
    import warp as wp

    wp.config.log_level = wp.LOG_ERROR
    kept = os.dup(2)
    null = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(null, 2)  # its native part writes there whatever the log level
        wp.init()
    finally:
        os.dup2(kept, 2)
        os.close(kept)
        os.close(null)


def open_named_view(
    registry: Registry,
    results: Path,
    scene: str,
    *,
    light: str | None,
    camera: str | None,
    size: str,
    pixel_samples: int,
    layers: int,
) -> OpenView:
    """Open the view that options name.

    Raises:
        ShadowbenchError: An option or the scene is wrong.
    """
    from shadowbench.experiment import parse_choice, parse_size
    from shadowbench.inspection.opening import open_view
    from shadowbench.runner.cases import RunOptions

    return open_view(
        registry,
        RunOptions(results=results).cache,
        parse_choice(scene),
        light=light,
        camera=camera,
        size=parse_size(size),
        pixel_samples=pixel_samples,
        layers=layers,
    )
