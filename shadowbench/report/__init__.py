"""The report: a run as one HTML file that is read offline, from its rows and pictures to its tables and environment.

::

    views.py cards.py           rows -> views (what shares a reference) and cards (what is said about a case)
    embedding.py masks.py       pictures and failure masks small enough to be inside the page
    full_size.py                the same in full size, in a folder beside it
    summary.py                  the head of the page: outcomes, claims, what won, notices
    sections.py downloads.py    an experiment's claims, tables and charts; files to take out of the page
    growth.py stage_bars.py pareto_plot.py    rows -> charts (chart.py says what one is)
    svg.py figures.py           charts -> the page, and figures for papers
    wording.py                  values as text
    page.py                     templates, style, scripts, Content-Security-Policy
    templates/ static/

Reads rows, artifacts and tables only; imports no Warp and no plugin.
"""

from __future__ import annotations

import os
import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

from shadowbench.errors import ExperimentError, UsageError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from shadowbench.report.embedding import Pool
    from shadowbench.report.full_size import Files
    from shadowbench.report.views import SceneView
    from shadowbench.rows import RunRecord
    from shadowbench.store import Store


def default_path(store: Store, run: RunRecord) -> Path:
    """Return where a run's report lies unless the user says otherwise: ``<results>/reports/<run id>.html``."""
    return store.folder / "reports" / f"{run.run_id}.html"


def write(store: Store, run: RunRecord, path: Path) -> Path:
    """Write the report of a run and return where; a file that is there is replaced once the new one is whole.

    Args:
        store: Holds the run's rows and pictures.
        run: The run.
        path: The HTML file; missing folders above it are made. Pictures in full size go to a folder beside it,
            ``<name>-pictures``.

    Raises:
        StoreError: The rows cannot be read. (A picture that cannot is shown as missing.)
        UsageError: The file cannot be written.
    """
    from shadowbench.report.full_size import folder_name, write_folder

    text, files = _made(store, run, folder_name(path))
    partial = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        partial.write_text(text, encoding="utf-8", newline="\n")
        partial.replace(path)
        write_folder(store, files, path.with_name(folder_name(path)))
    except OSError as error:
        partial.unlink(missing_ok=True)
        raise UsageError(f"the report {path} cannot be written: {error.strerror}") from error
    return path


def html(store: Store, run: RunRecord) -> str:
    """Return the report of a run as text, without links to pictures in full size.

    Raises:
        StoreError: The rows cannot be read.
    """
    return _made(store, run, "")[0]


def write_figures(store: Store, run: RunRecord, folder: Path) -> list[Path]:
    """Write the charts of a run as PDF and SVG for papers and return the files; the same rows give the same bytes.

    Raises:
        StoreError: The rows cannot be read.
        UsageError: The folder cannot be written.
    """
    from shadowbench.report import sections
    from shadowbench.report.embedding import PicturePool
    from shadowbench.report.figures import write_figures as write_all
    from shadowbench.report.views import scene_views

    rows = store.rows(run.run_id)
    views = scene_views(run, rows, PicturePool(store.artifact))
    return write_all(sections.all_charts(run, rows, views), folder)


def _made(store: Store, run: RunRecord, folder: str) -> tuple[str, Files]:
    import shadowbench
    from shadowbench.report import downloads, page, sections
    from shadowbench.report.embedding import PicturePool, picture_budget
    from shadowbench.report.full_size import files_of
    from shadowbench.report.summary import summarize
    from shadowbench.report.views import scene_views
    from shadowbench.tables.claims import answer_claims

    rows = store.rows(run.run_id)
    asked = PicturePool(store.artifact, picture_budget(len(rows)))
    views = scene_views(run, rows, asked)
    pool = asked.encode()
    notices = []
    try:
        claims = answer_claims(run, rows)
    except ExperimentError as error:  # of another version, say; the rest of the page stands
        claims = ()
        notices.append(f"The claims cannot be answered: {error}")
    files = files_of(views)
    text = page.render(
        content=_content(views, pool, folder, files),
        pictures=pool.addresses,
        summary=summarize(run, rows, views, claims, pool, notices),
        experiments=sections.experiment_parts(run, rows, views, claims),
        pareto=sections.pareto_plots(rows, views),
        views=views,
        layer_names=_layer_names(views),
        lost=pool.lost,
        run_downloads=downloads.run_downloads(run, rows) if rows else [],
        folder=folder if files else "",
        argv=shlex.join(run.argv),
        version=shadowbench.__version__,
    )
    return text, files


def _layer_names(views: Sequence[SceneView]) -> list[str]:
    """Return every kind of further picture, in order of appearance."""
    return list(dict.fromkeys(name for view in views for name in view.layer_names))


def _content(views: Sequence[SceneView], pool: Pool, folder: str, files: Files) -> dict[str, Any]:
    """Return what the script needs: views, their cases, and the colours of failure masks."""
    from shadowbench.report import masks, wording
    from shadowbench.tables.plain_text import shortened

    def full_size(anchor: str) -> list[list[str]]:
        listed = files.get(anchor, ()) if folder else ()
        return [[wording.shown(shown), f"{quote(folder)}/{file}"] for shown, file, _ in listed]

    return {
        "layers": [shortened(wording.shown(name)) for name in _layer_names(views)],
        "leftOut": sorted(pool.left_out),
        "kinds": [[name, masks.PART_OF.get(name, "")] for name in masks.KINDS],
        "palette": masks.palette(),
        "views": [
            {
                "id": view.anchor,
                "title": wording.shown(view.title),
                "reference": view.reference,
                "files": full_size(view.anchor),
                "size": [view.width, view.height],
                "cases": [card.as_json() | {"files": full_size(card.anchor)} for card in view.cards],
            }
            for view in views
        ],
    }
