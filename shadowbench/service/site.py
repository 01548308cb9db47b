"""All pages as files, for a web server that runs nothing: the same templates, with addresses that lead to files.

Every page has the address of the live one plus ``.html`` and its JSON and CSV beside it; forms, comparisons and
searches, which need a program, are left out. Files of an earlier export are replaced, or go if no run has them now.
"""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

from shadowbench import report
from shadowbench.errors import StoreError, UsageError
from shadowbench.service import answers, histories, rendering, standings
from shadowbench.service.pictures import PictureError, encoded_again
from shadowbench.service.problems import Problem
from shadowbench.service.responding import Answer
from shadowbench.store import Store
from shadowbench.store.catalogue import Catalogue, RunFilter

_LIST = ".shadowbench-site.json"
_MOST_PIXELS = 33_554_432
_MOST_RUNS = 1_000_000
_SAFE = re.compile(r"[A-Za-z0-9._-]{1,120}")


def write_site(store: Store, folder: Path, title: str) -> int:
    """Write the site and return how many files it has.

    Args:
        store: Its runs.
        folder: Where to: empty, missing, or with an earlier site.
        title: What pages call it.

    Raises:
        UsageError: There is something else in the folder, or it cannot be written.
    """
    rendering.use_title(title)
    try:
        return _Site(store, folder).write()
    except OSError as error:
        raise UsageError(f"{folder}: the site cannot be written: {error.strerror}") from error


class _Site:
    def __init__(self, store: Store, folder: Path) -> None:
        self.store, self.folder = store, folder
        self.catalogue = Catalogue(store)
        self.written: set[str] = set()

    def write(self) -> int:
        earlier = self._earlier()
        try:
            self._lists()
            for run in self.catalogue.runs(RunFilter(), limit=_MOST_RUNS):
                self._run(run.run_id)
        finally:
            self.catalogue.close()
        self._file(
            "index.html", '<!DOCTYPE html><meta http-equiv="refresh" content="0; url=runs.html"><title>Runs</title>'
        )
        self._file(".nojekyll", "")
        for name in earlier - self.written:
            self.folder.joinpath(name).unlink(missing_ok=True)
        self._file(_LIST, json.dumps(sorted(self.written)))
        return len(self.written)

    def _earlier(self) -> set[str]:
        if not self.folder.exists() or not any(self.folder.iterdir()):
            return set()
        try:
            names = json.loads(self.folder.joinpath(_LIST).read_text(encoding="utf-8"))
        except (OSError, ValueError):
            raise UsageError(f"{self.folder}: is not empty and holds no site that was exported before") from None
        return {name for name in names if isinstance(name, str) and ".." not in name and not name.startswith("/")}

    def _lists(self) -> None:
        self._page("runs", answers.runs(self.catalogue, RunFilter(), limit=_MOST_RUNS, after=""))
        self._page("experiments", answers.experiments(self.catalogue))
        self._page("methods", answers.methods(self.catalogue))
        self._page("machines", answers.machines(self.catalogue))
        facets = self.catalogue.facets()
        for name in filter(_SAFE.fullmatch, facets["experiment"]):
            try:
                found = standings.leaderboard(self.catalogue, name)
            except Problem:
                continue  # an experiment without a row
            self._page(f"experiments/{name}", found)
        for name in filter(_SAFE.fullmatch, facets["method"]):
            chosen: dict[str, Any] = {"experiment": "", "view": "", "machine": "", "technique": ""}
            self._page(f"methods/{name}", histories.history(self.catalogue, name, **chosen, measure="dynamic_frame_ms"))

    def _run(self, run_id: str) -> None:
        if not _SAFE.fullmatch(run_id):
            return
        found = answers.run(self.store, run_id)
        self._page(f"runs/{run_id}", found)
        record = answers.find_run(self.store, run_id)
        self._file(f"runs/{run_id}/report.html", report.html(self.store, record))
        for row in found.content["rows"]:
            if _SAFE.fullmatch(row.case_key):
                case = answers.case(self.store, run_id, row.case_key, row.experiment)
                self._page(f"runs/{run_id}/cases/{row.case_key}", case)
            for name in row.artifacts.values():
                self._picture(name)

    def _page(self, name: str, answer: Answer) -> None:
        depth = name.count("/")
        relative = "/".join([".."] * depth) or "."
        self._file(f"{name}.html", answer.text("html", site=True, relative=relative, suffix=".html", request=None))
        self._file(f"{name}.json", answer.text("json"))
        self._file(f"{name}.csv", answer.text("csv"))

    def _picture(self, name: str) -> None:
        path = f"artifacts/{name}"
        if path in self.written:
            return
        try:
            content = encoded_again(self.store.artifact(name), _MOST_PIXELS)
        except (StoreError, PictureError):
            return  # the page says so in its place
        self._file(path, content)

    def _file(self, name: str, content: str | bytes) -> None:
        path = self.folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content.encode("utf-8") if isinstance(content, str) else content)
        self.written.add(name)
