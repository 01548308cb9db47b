"""The report: a run as one HTML file that is read offline, from its rows and pictures to its tables and environment.

::

    cases.py      rows -> views (what shares a reference) and cards (what is said about a case)
    summary.py    the head of the page: outcomes, what won, notices
    embedding.py  pictures small enough to be inside the page
    wording.py    values as text
    page.py       templates, style, script, Content-Security-Policy
    templates/ static/

Reads rows, artifacts and tables only; imports no Warp and no plugin.
"""

from __future__ import annotations

import os
import shlex
from pathlib import Path
from typing import TYPE_CHECKING

from shadowbench.errors import UsageError

if TYPE_CHECKING:
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
        path: The HTML file; missing folders above it are made.

    Raises:
        StoreError: The rows cannot be read. (A picture that cannot is shown as missing.)
        UsageError: The file cannot be written.
    """
    text = html(store, run)
    partial = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        partial.write_text(text, encoding="utf-8", newline="\n")
        partial.replace(path)
    except OSError as error:
        partial.unlink(missing_ok=True)
        raise UsageError(f"the report {path} cannot be written: {error.strerror}") from error
    return path


def html(store: Store, run: RunRecord) -> str:
    """Return the report of a run as text.

    Raises:
        StoreError: The rows cannot be read.
    """
    import shadowbench
    from shadowbench import tables
    from shadowbench.report import embedding, page
    from shadowbench.report.cases import picture_count, scene_views
    from shadowbench.report.summary import summarize

    rows = store.rows(run.run_id)
    embedder = embedding.Embedder(
        store.artifact, picture_count=picture_count(rows), byte_budget=embedding.PICTURE_BYTES
    )
    views = scene_views(run, rows, embedder)
    return page.render(
        summary=summarize(run, rows, views),
        tables=tables.make(rows, run=run) if rows else [],
        views=views,
        argv=shlex.join(run.argv),
        version=shadowbench.__version__,
    )
