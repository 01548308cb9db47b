"""Rows put together by view: what shares a reference picture may be compared, and stands side by side in the gallery.

A *view* is a scene with its parameters, a light, a camera and a picture size. Cases stand in it in the order they were
measured, whatever their outcome.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from shadowbench.report import wording
from shadowbench.report.cards import Card, Facts, card_of
from shadowbench.report.embedding import PicturePool, Priority
from shadowbench.rows import RATIOS, ResultRow, RunRecord
from shadowbench.tables.labels import Labels
from shadowbench.tables.verdicts import Verdicts

Key = tuple[str, str, str, str, int, int, int, int]


@dataclass(frozen=True)
class SceneView:
    """The cases of one view, beside one reference picture.

    Attributes:
        anchor: Its id in the page.
        title: Scene, light and camera.
        facts: What the view consists of.
        reference: Number of the reference picture, 0 for none.
        reference_file: Its artifact.
        width, height: Of the pictures [pixels].
        cards: Its cases.
    """

    anchor: str
    title: str
    facts: Facts
    reference: int
    reference_file: str
    width: int
    height: int
    cards: list[Card]

    @property
    def layer_names(self) -> list[str]:
        """Every kind of further picture that a case of the view has."""
        return list(dict.fromkeys(name for card in self.cards for name, _ in card.layers))


def view_key(row: ResultRow) -> Key:
    """Return what two rows must share to be compared with one reference."""
    parameters = json.dumps(row.scene_parameters, sort_keys=True, default=str)
    picture = (row.width, row.height, row.pixel_samples, row.layers)
    return (row.scene, parameters, row.light, row.camera, *picture)


def by_view(rows: Iterable[ResultRow]) -> list[list[ResultRow]]:
    """Return the rows of each view, in the order in which the views first appear."""
    groups: dict[Key, list[ResultRow]] = {}
    for row in rows:
        groups.setdefault(view_key(row), []).append(row)
    return list(groups.values())


def scene_views(run: RunRecord, rows: Sequence[ResultRow], pool: PicturePool) -> list[SceneView]:
    """Return the gallery: every row as a card, in its view; their pictures are asked of the pool."""
    labels = Labels("scene", rows)
    views = []
    for number, group in enumerate(by_view(rows), 1):
        first, anchor = group[0], f"view-{number}"
        verdicts = Verdicts(group, rows, RATIOS)
        reference = next((row.artifacts["reference"] for row in group if "reference" in row.artifacts), "")
        views.append(
            SceneView(
                anchor=anchor,
                title=f"{labels.of(first)}, light {first.light}, camera {first.camera}",
                facts=_facts(group),
                reference=pool.picture(reference, Priority.REFERENCE) if reference else 0,
                reference_file=reference,
                width=first.width,
                height=first.height,
                cards=[
                    card_of(run, row, title, f"{anchor}-case-{place}", pool, verdicts)
                    for place, (row, title) in enumerate(zip(group, titles(group, run), strict=True), 1)
                ],
            )
        )
    return views


def titles(rows: Sequence[ResultRow], run: RunRecord) -> list[str]:
    """Return each row's method label; of rows that share one, also what moves, the threads, device or experiment."""
    labels = Labels("method", rows, defaults=run.method_defaults)
    found = [labels.of(row) for row in rows]
    for field, text in (
        ("moving", "moving: {}"),
        ("threads", "threads: {}"),
        ("device", "on {}"),
        ("experiment", "in {}"),
    ):
        if len(set(found)) < len(found) and len({getattr(row, field) for row in rows}) > 1:
            found = [
                f"{label}, {text.format(getattr(row, field))}" if found.count(label) > 1 else label
                for label, row in zip(found, rows, strict=True)
            ]
    return found


def _facts(group: Sequence[ResultRow]) -> Facts:
    first = group[0]
    measured = next((r for r in group if r.receivers is not None), first)
    facts = [(key, str(value)) for key, value in first.scene_parameters.items()]
    facts.append(("picture", f"{first.width} \u00d7 {first.height} pixels"))
    if first.pixel_samples > 1:
        facts.append(("samples of every pixel", str(first.pixel_samples)))
    if first.layers > 1:
        facts.append(("layers", f"up to {first.layers}"))
    if measured.triangles is not None:
        facts.insert(0, ("triangles in all", wording.count(measured.triangles)))
    if measured.receivers is not None:
        facts.append(("receivers", wording.count(measured.receivers)))
        facts.append(("scored", wording.count(measured.scored)))
    return facts
