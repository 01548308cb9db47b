"""Small pictures side by side: the truth and some techniques' results, their failing receivers below."""

from __future__ import annotations

import io
from collections.abc import Sequence
from dataclasses import dataclass

from PIL import Image

from shadowbench.rows import Outcome, ResultRow
from shadowbench.store import Store
from shadowbench.tables.labels import Labels

MOST_RESULTS = 5
"""On one sheet, beside the truth."""

MOST_SHEETS = 2
"""Of one experiment."""

_WIDTH, _GAP, _QUALITY = 280, 4, 78


@dataclass(frozen=True)
class Sheet:
    """Pictures of one view.

    Attributes:
        name: Of the file.
        view: What is seen.
        labels: Whose results, from the left; the truth stands before them.
        content: The file, WebP.
    """

    name: str
    view: str
    labels: tuple[str, ...]
    content: bytes


def sheets_of(store: Store, rows: Sequence[ResultRow], labels: Labels) -> list[Sheet]:
    """Return the sheets of an experiment: its first views, each with its most different techniques.

    Raises:
        StoreError: A picture is missing or damaged.
    """
    views: dict[tuple[object, ...], list[ResultRow]] = {}
    for row in rows:
        if row.outcome is Outcome.OK and {"reference", "result", "failures"} <= row.artifacts.keys():
            key = (row.scene, str(row.scene_parameters), row.light, row.camera, row.width, row.height)
            views.setdefault(key, []).append(row)
    found = list(views.values())
    step = max(1.0, len(found) / MOST_SHEETS)
    picked = [found[int(number * step)] for number in range(min(len(found), MOST_SHEETS))]
    sheets = []
    for number, own in enumerate(picked, 1):
        first = own[0]
        shown = _spread(own)
        view = f"{first.scene}, light {first.light}, camera {first.camera}, {first.width}x{first.height}"
        image = sheet(store, shown, width=_WIDTH)
        content = io.BytesIO()
        image.save(content, "WEBP", quality=_QUALITY, method=6)
        names = tuple(labels.of(row) for row in shown)
        sheets.append(Sheet(f"pictures-{number}.webp", view, names, content.getvalue()))
    return sheets


def sheet(store: Store, rows: Sequence[ResultRow], *, width: int) -> Image.Image:
    """Return the truth and the results of some cases of one view above their failures.

    Args:
        store: Where the pictures are.
        rows: The cases.
        width: Of one picture [pixels].
    """
    names: list[tuple[str, str | None]] = [(rows[0].artifacts["reference"], None)]
    names += [(row.artifacts["result"], row.artifacts["failures"]) for row in rows]
    height = max(1, round(width * rows[0].height / rows[0].width))
    size = (len(names) * (width + _GAP) - _GAP, 2 * height + _GAP)
    whole = Image.new("RGB", size, "white")
    for column, pair in enumerate(names):
        for line, name in enumerate(pair):
            if name is not None:
                with Image.open(io.BytesIO(store.artifacts.get(name))) as picture:
                    small = picture.convert("RGB").resize((width, height), Image.Resampling.LANCZOS)
                whole.paste(small, (column * (width + _GAP), line * (height + _GAP)))
    return whole


def _spread(rows: Sequence[ResultRow]) -> list[ResultRow]:
    """Return one case of each technique, then others evenly spread, in their order."""
    chosen = list({row.method: number for number, row in reversed(list(enumerate(rows)))}.values())[:MOST_RESULTS]
    others = [number for number in range(len(rows)) if number not in chosen]
    room = MOST_RESULTS - len(chosen)
    if room > 0 and others:
        step = max(1.0, len(others) / room)
        chosen += [others[int(number * step)] for number in range(min(room, len(others)))]
    return [rows[number] for number in sorted(chosen)]
