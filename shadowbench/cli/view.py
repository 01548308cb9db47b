"""``shadowbench view``: a case seen from near, one receiver of it in numbers or the whole in space."""

from __future__ import annotations

import json
import re
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from shadowbench.cli.console import complain, reserved_stdout
from shadowbench.cli.options import DEFAULT_RESULTS, PluginOption, ResultsOption, open_store
from shadowbench.cli.views import CaseArgument, quieten_warp
from shadowbench.errors import UsageError

if TYPE_CHECKING:
    from shadowbench.inspection.opening import OpenCase
    from shadowbench.rows import ResultRow


def view(
    case: CaseArgument,
    pixel: Annotated[
        str | None,
        typer.Option("--pixel", metavar="X,Y", help="Everything about this pixel's receiver.", show_default=False),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option(
            "--output",
            "-o",
            metavar="FILE",
            help="Without --pixel: a .png or .jpg, or a .html to turn and zoom, instead of a window.",
            show_default=False,
        ),
    ] = None,
    sample: Annotated[
        int, typer.Option("--sample", metavar="N", help="Which of the pixel's receivers, from 0.", min=0)
    ] = 0,
    as_json: Annotated[bool, typer.Option("--json", help="With --pixel: one JSON value on standard output.")] = False,
    plugin: PluginOption = None,
    results: ResultsOption = DEFAULT_RESULTS,
) -> None:
    """Look into a case: its scene, shadows, failures, light and camera in space, or one pixel's receiver in numbers."""
    at = None if pixel is None else _pixel(pixel)
    if at is None:
        from shadowbench.inspection.showing import must_be_possible

        if as_json or sample:
            raise UsageError("--json and --sample need --pixel X,Y")
        must_be_possible(output)
    elif output is not None:
        raise UsageError("--output is of the view in space: it goes without --pixel")
    with open_store(results) as store:
        from shadowbench.inspection.finding import find_case

        row = find_case(store, case)
    quieten_warp()
    with reserved_stdout() as stream:  # kernels and plugins may print
        opened = _open(row, results, plugin)
        if at is None:
            _show_in_space(opened, output)
            stream.write("" if output is None else f"{output}\n")
            return
        said = _look(opened, at, sample)
        if as_json:
            stream.write(json.dumps(said, allow_nan=False) + "\n")
            return
    from shadowbench.cli.receiver_text import show

    for note in opened.notes:
        complain(f"note: {note}")
    sys.stdout.flush()
    show(said)


def _open(row: ResultRow, results: Path, plugin: list[Path] | None) -> OpenCase:
    from shadowbench.inspection.opening import open_case

    return open_case(row, results, tuple(plugin or ()))


def _show_in_space(opened: OpenCase, output: Path | None) -> None:
    from shadowbench.inspection.showing import show
    from shadowbench.inspection.space import laid_out

    for note in opened.notes:
        complain(f"note: {note}")
    show(*laid_out(opened), output)


def _look(opened: OpenCase, at: tuple[int, int], sample: int) -> dict[str, Any]:
    """Return what is known of a pixel, as JSON values."""
    from shadowbench.inspection.receiver import nearest_pixel, receiver_at, report_on
    from shadowbench.rows import method_label

    row, view = opened.row, opened.seen.view
    said: dict[str, Any] = {
        "run_id": row.run_id,
        "case_key": row.case_key,
        "method": method_label(row.method, row.method_parameters),
        "view": str(view),
        "pixel": list(at),
        "notes": list(opened.notes),
        "receiver": None,
    }
    index = receiver_at(opened.seen, *at, sample)
    if index is None:
        said["nearest"] = list(nearest_pixel(opened.seen, *at))
    else:
        said["receiver"] = report_on(opened, index).as_json()
    return said


def _pixel(text: str) -> tuple[int, int]:
    found = re.fullmatch(r"\s*(\d{1,6})\s*,\s*(\d{1,6})\s*", text, re.ASCII)
    if found is None:
        raise UsageError(f"--pixel: a pixel is written X,Y from the upper left corner, like 320,240, not '{text}'")
    return int(found[1]), int(found[2])
