"""Writing a run as a folder of published results, and reading the rows of one."""

from __future__ import annotations

import io
import json
import shutil
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from shadowbench.errors import UsageError
from shadowbench.publication import pages
from shadowbench.publication.sample import sampled
from shadowbench.publication.sheets import sheet, sheets_of
from shadowbench.rows import ResultRow, RunRecord
from shadowbench.store import Store
from shadowbench.tables.claims import answer_claims
from shadowbench.tables.csv_text import as_tidy_csv, rows_of_tidy_csv
from shadowbench.tables.labels import Labels

VISIBILITY = "visibility"
"""Folder of the sampled cases' results."""

_PUBLIC = ("run_id", "created_at", "finished_at", "case_count", "code_version", "machine", "experiments", "environment")
"""What ``run.json`` holds of a run; its command line names folders of one machine."""

_FRONT = ("quick", "bunny", "sun", "shadow-map")
"""Experiment, scene, light and method of the picture in the project's own README."""


def write_folder(
    store: Store, run: RunRecord, folder: Path, levels_of: Callable[[ResultRow], NDArray[np.uint8]]
) -> int:
    """Write a run's pages, rows and pictures; what an earlier run left there for the same experiments is replaced.

    Args:
        store: The open results folder.
        run: The run.
        folder: Where to; made if it is not there.
        levels_of: Computes a sampled case again: its visibility by pixel, 0 to 255, shape [height, width] or
            [height, width, 3].

    Returns:
        How many cases are sampled.

    Raises:
        UsageError: The folder cannot be written, or holds something else where an experiment's pages belong.
        StoreError: A picture is missing or damaged.
    """
    places = {str(definition["name"]): _place(folder, str(definition["name"])) for definition in run.definitions}
    rows = [row.model_copy(update={"stderr_tail": ""}) for row in store.rows(run.run_id)]
    answers = answer_claims(run, rows)
    sample = sampled(rows)
    try:
        (folder / VISIBILITY).mkdir(parents=True, exist_ok=True)
        for old in (folder / VISIBILITY).glob("*.png"):
            old.unlink()
        for row in sample:
            Image.fromarray(levels_of(row)).save(folder / VISIBILITY / f"{row.case_key}.png", optimize=True)
        for definition in run.definitions:
            name = str(definition["name"])
            own = [row for row in rows if row.experiment == name]
            if own:
                _write_experiment(store, run, definition, own, places[name])
        about = run.model_dump(mode="json", include=set(_PUBLIC))
        (folder / "run.json").write_text(json.dumps(about, indent=1) + "\n", encoding="utf-8")
        _write_front_picture(store, rows, folder)
        (folder / "README.md").write_text(pages.front_page(run, rows, answers, len(sample)), encoding="utf-8")
    except OSError as error:
        raise UsageError(f"--to {folder}: {error.filename or ''} cannot be written: {error.strerror}") from error
    return len(sample)


def read_rows(folder: Path) -> list[ResultRow]:
    """Return all rows of published results, experiments in alphabetical order.

    Raises:
        UsageError: The folder has none, or a file of rows is damaged; names file and line.
    """
    files = sorted(folder.glob("*/rows.csv"))
    if not files:
        raise UsageError(f"{folder} holds no published results: no experiment's rows.csv is in it")
    rows: list[ResultRow] = []
    for file in files:
        try:
            rows += rows_of_tidy_csv(file.read_text(encoding="utf-8"), str(file))
        except OSError as error:
            raise UsageError(f"{file} cannot be read: {error.strerror}") from error
        except UnicodeDecodeError:
            raise UsageError(f"{file} cannot be read: it is not UTF-8 text") from None
    return rows


def read_sample(folder: Path) -> dict[str, NDArray[np.uint8]]:
    """Return case key -> visibility by pixel, 0 to 255, of the cases that are computed again.

    Raises:
        UsageError: A picture cannot be read.
    """
    found = {}
    for file in sorted((folder / VISIBILITY).glob("*.png")):
        try:
            with Image.open(io.BytesIO(file.read_bytes())) as picture:
                found[file.stem] = np.asarray(picture, np.uint8)
        except (OSError, SyntaxError, ValueError) as error:
            raise UsageError(f"{file} cannot be read: {error}") from None
    return found


def _place(folder: Path, experiment: str) -> Path:
    """Return where an experiment's pages go; only pages that were published before may be there.

    Raises:
        UsageError: Something else is there, or the experiment's name is none of a folder.
    """
    place = folder / experiment
    if Path(experiment).name != experiment or experiment in ("", "..", VISIBILITY):
        raise UsageError(f"experiment '{experiment}' cannot be published: its name is no folder's")
    is_published = (place / "rows.csv").is_file() and (place / "README.md").is_file()
    if place.exists() and not is_published and not (place.is_dir() and not any(place.iterdir())):
        raise UsageError(f"--to {folder}: {place} is there and holds no published experiment; name another folder")
    return place


def _write_experiment(
    store: Store, run: RunRecord, definition: Mapping[str, object], rows: Sequence[ResultRow], folder: Path
) -> None:
    if folder.exists():
        shutil.rmtree(folder)
    folder.mkdir()
    answers = [answer for answer in answer_claims(run, rows) if answer.experiment == definition["name"]]
    sheets = sheets_of(store, rows, Labels("method", rows, defaults=run.method_defaults))
    for each in sheets:
        (folder / each.name).write_bytes(each.content)
    # pictures by the names of a results folder would say nothing here
    plain_rows = [row.model_copy(update={"artifacts": {}}) for row in rows]
    (folder / "rows.csv").write_text(as_tidy_csv(plain_rows), encoding="utf-8")
    page = pages.experiment_page(run, definition, rows, answers, sheets)
    (folder / "README.md").write_text(page, encoding="utf-8")


def _write_front_picture(store: Store, rows: Sequence[ResultRow], folder: Path) -> None:
    shown = [row for row in rows if (row.experiment, row.scene, row.light, row.method) == _FRONT and row.artifacts]
    if shown:
        sheet(store, shown, width=200).save(folder / "bunny-biases.png", optimize=True)
