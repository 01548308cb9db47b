"""Runs as one file, to be mailed, archived or put into another store: ``export`` and ``import``.

A zip archive, which other programs can read as well::

    manifest.json               format, version, and of every run: id, number of rows, digest
    runs/<run id>/run.json      the run
    runs/<run id>/rows.jsonl    its rows, one document a line; this is what is imported
    runs/<run id>/rows.csv      the same rows for spreadsheets, without samples
    runs/<run id>/rows.parquet  in place of both: rows in typed columns, samples too, and imported from these
    artifacts/<sha256>.<suffix> pictures and masks

Importing trusts nothing: names of members are compared with what they must be and never become paths, sizes are
bounded before anything is unpacked, every document is validated, every file is checked against its name and every run
against its digest. Each run is kept wholly or not at all.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import zipfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from shadowbench.errors import StoreError
from shadowbench.rows import ResultRow, RunRecord
from shadowbench.store import parquet
from shadowbench.store.artifacts import ARTIFACT_NAME
from shadowbench.store.documents import (
    RUN_ID,
    DocumentError,
    artifact_names,
    parsed,
    row_document,
    rows_from_documents,
    run_document,
    run_from_document,
)
from shadowbench.store.engine import store_errors
from shadowbench.store.results import Store
from shadowbench.store.uploads import IMPORTED, Kept, Uploader, digest_of, put_run

FORMAT = "shadowbench runs"
VERSION = 1

LARGEST_ARTIFACT = 64 * 2**20
LARGEST_DOCUMENT = 512 * 2**20
"""Unpacked sizes [bytes]."""

_LARGEST_RATIO = 200
_ALWAYS_ALLOWED = 64 * 2**20
_MEMBER = re.compile(
    rf"manifest\.json|runs/{RUN_ID}/(run\.json|rows\.jsonl|rows\.csv|rows\.parquet)|artifacts/{ARTIFACT_NAME.pattern}"
)


@dataclass(frozen=True)
class Imported:
    """One run of a file, and what became of it."""

    run: RunRecord
    row_count: int
    kept: Kept


def export_runs(
    store: Store, runs: Sequence[RunRecord], path: Path, as_csv: Callable[[Sequence[ResultRow]], str] | None
) -> None:
    """Write runs with all that belongs to them to one file, which appears whole or not at all.

    Args:
        store: Holds them.
        runs: The runs.
        path: The file; one that is there is replaced.
        as_csv: Writes rows for spreadsheets; ``None`` for rows as Parquet.

    Raises:
        StoreError: A picture is missing or damaged, the file cannot be written, or pyarrow is not installed.
    """
    if as_csv is None:
        parquet.check_extra()
    with written_whole(path, "write the runs") as partial, zipfile.ZipFile(partial, "w", zipfile.ZIP_DEFLATED) as file:
        manifest: list[dict[str, Any]] = []
        artifacts: dict[str, None] = {}
        for run in runs:
            rows = store.rows(run.run_id)
            folder = f"runs/{run.run_id}"
            file.writestr(f"{folder}/run.json", _json(run_document(run)))
            if as_csv is None:
                file.writestr(f"{folder}/rows.parquet", parquet.as_parquet(rows), compress_type=zipfile.ZIP_STORED)
            else:
                file.writestr(f"{folder}/rows.jsonl", "".join(_json(row_document(row)) for row in rows))
                file.writestr(f"{folder}/rows.csv", as_csv(rows))
            artifacts |= dict.fromkeys(artifact_names(rows))
            manifest.append({"run_id": run.run_id, "row_count": len(rows), "digest": digest_of(run, rows)})
        for name in artifacts:
            file.writestr(f"artifacts/{name}", store.artifact(name), compress_type=zipfile.ZIP_STORED)
        file.writestr("manifest.json", _json({"format": FORMAT, "version": VERSION, "runs": manifest}))


def import_runs(store: Store, path: Path, *, replace: bool = False) -> list[Imported]:
    """Put the runs of a file into the store; those that are there already stay as they are.

    Args:
        store: Where to.
        path: What :func:`export_runs` wrote.
        replace: Let runs of the file take the place of runs with the same id and other content.

    Raises:
        ConflictError: A run of the store has the id of another one in the file.
        StoreError: The file is none of ours or is damaged; runs before the faulty one are kept.
    """
    with store_errors(path, "read the runs"):
        try:
            with zipfile.ZipFile(path) as file:
                return list(_imported(store, _Archive(file, path), replace=replace))
        except (zipfile.BadZipFile, EOFError, NotImplementedError, RuntimeError) as error:
            raise StoreError(f"{path}: is not an undamaged file of runs: {error}") from error
        except DocumentError as error:
            raise StoreError(f"{path}: {error}") from error


@contextmanager
def written_whole(path: Path, action: str) -> Iterator[Path]:
    """Yield a path beside ``path`` whose file takes its place when the block ends well, and goes when it does not."""
    partial = path.with_name(f".{path.name}.{os.getpid()}")
    with store_errors(path, action):
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            yield partial
            with partial.open("rb") as file:
                os.fsync(file.fileno())
            partial.replace(path)
        finally:
            partial.unlink(missing_ok=True)


class _Archive:
    """A zip archive whose members are known to have names and sizes that they may have."""

    def __init__(self, file: zipfile.ZipFile, path: Path) -> None:
        self._file, self._path = file, path
        allowed = max(_ALWAYS_ALLOWED, _LARGEST_RATIO * path.stat().st_size)
        self.members: dict[str, zipfile.ZipInfo] = {}
        for member in file.infolist():
            if not _MEMBER.fullmatch(member.filename) or member.filename in self.members:
                raise StoreError(f"{path}: {member.filename!a:.80} does not belong into a file of runs")
            largest = LARGEST_ARTIFACT if member.filename.startswith("artifacts/") else LARGEST_DOCUMENT
            allowed -= member.file_size
            if member.file_size > largest or allowed < 0:
                raise StoreError(f"{path}: {member.filename} unpacks to more than is allowed")
            self.members[member.filename] = member

    def read(self, name: str) -> bytes:
        if name not in self.members:
            raise StoreError(f"{self._path}: lacks {name}")
        return self._file.read(self.members[name])


def _imported(store: Store, archive: _Archive, *, replace: bool) -> Iterator[Imported]:
    manifest = parsed(archive.read("manifest.json"), "manifest.json")
    if not isinstance(manifest, dict) or manifest.get("format") != FORMAT or not isinstance(manifest.get("runs"), list):
        raise DocumentError("manifest.json", f"is not that of '{FORMAT}'")
    if manifest.get("version") != VERSION:
        raise DocumentError("manifest.json", f"is of version {manifest.get('version')!r:.20}; {VERSION} can be read")
    for entry in manifest["runs"]:
        run_id = entry.get("run_id") if isinstance(entry, dict) else None
        if not isinstance(run_id, str) or not re.fullmatch(RUN_ID, run_id):
            raise DocumentError("manifest.json", "names a run that is none")
        place = f"runs/{run_id}"
        run = run_from_document(parsed(archive.read(f"{place}/run.json"), f"{place}/run.json"), f"{place}/run.json")
        name, lines = _row_lines(archive, place)
        documents = [parsed(line, f"{name}:{number}") for number, line in enumerate(lines, 1)]
        rows = rows_from_documents(documents, run, name)
        if run.run_id != run_id or digest_of(run, rows) != entry.get("digest"):
            raise DocumentError(place, "is not the run that the manifest names")
        for name in artifact_names(rows):
            content = archive.read(f"artifacts/{name}")
            stem, _, suffix = name.partition(".")
            if hashlib.sha256(content).hexdigest() != stem:
                raise DocumentError(f"artifacts/{name}", "is damaged: its content does not have this SHA-256")
            store.put_artifact(content, suffix)
        kept = put_run(store, run, rows, Uploader(IMPORTED, "command line", may_replace=replace))
        yield Imported(run, kept.row_count, kept.kept)


def _row_lines(archive: _Archive, place: str) -> tuple[str, list[bytes]]:
    """Return the name of the member that has a run's rows, and the rows as JSON texts."""
    name = f"{place}/rows.parquet"
    if name in archive.members and f"{place}/rows.jsonl" not in archive.members:
        return name, parquet.lines_from_parquet(archive.read(name), name, LARGEST_DOCUMENT).splitlines()
    name = f"{place}/rows.jsonl"
    return name, archive.read(name).splitlines()


def _json(document: Any) -> str:
    return json.dumps(document, separators=(",", ":"), allow_nan=False) + "\n"
