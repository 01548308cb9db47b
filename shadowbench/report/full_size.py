"""Pictures in full size in a folder beside the page, under names that say what they are.

The files are links to those in the results folder where the file system can make them, else copies. The page loads
none of them; it only links to them.
"""

from __future__ import annotations

import os
import re
import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path

from shadowbench.errors import StoreError
from shadowbench.report.views import SceneView
from shadowbench.store import Store

_OWN_NAME = re.compile(r"view-\d+-(case-\d+-)?[a-z0-9-]+\.png")
_OTHER = re.compile(r"[^a-z0-9]+")

Files = Mapping[str, Sequence[tuple[str, str, str]]]
"""Anchor of a case, or of a view for its reference -> (what it shows, file name, artifact)."""


def folder_name(page: Path) -> str:
    """Return the name of the folder beside a page."""
    return f"{page.stem}-pictures"


def files_of(views: Sequence[SceneView]) -> Files:
    """Return the files of all cases and views."""
    found: dict[str, list[tuple[str, str, str]]] = {}
    for view in views:
        if view.reference_file:
            found[view.anchor] = [("reference", f"{view.anchor}-reference.png", view.reference_file)]
        for card in view.cards:
            for name, artifact in card.files:
                slug = _OTHER.sub("-", name.lower()).strip("-")[:60] or "picture"
                own = found.setdefault(card.anchor, [])
                taken = {file for _, file, _ in own}
                file = f"{card.anchor}-{slug}.png"
                file = file if file not in taken else f"{card.anchor}-{slug}-{len(own)}.png"
                own.append((name.removeprefix("picture-"), file, artifact))
    return found


def write_folder(store: Store, files: Files, folder: Path) -> None:
    """Write the folder; what an earlier report put there and this one does not have is removed, nothing else.

    Raises:
        OSError: It cannot be written.
    """
    wanted = {file: artifact for listed in files.values() for _, file, artifact in listed}
    if folder.is_dir():
        for entry in folder.iterdir():
            if _OWN_NAME.fullmatch(entry.name):
                entry.unlink()
    for file, artifact in wanted.items():
        try:
            source = store.artifacts.path(artifact)
        except StoreError:
            continue
        if source.is_file():
            folder.mkdir(parents=True, exist_ok=True)
            _linked(source, folder / file)


def _linked(source: Path, target: Path) -> None:
    try:
        os.link(source, target)
    except OSError:
        shutil.copyfile(source, target)
