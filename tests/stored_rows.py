"""A run and rows that look measured, for tests of what reads them. Nothing is measured here."""

from __future__ import annotations

import io
import itertools
from typing import Any

import numpy as np
from PIL import Image

from shadowbench.rows import Outcome, ResultRow, RunRecord, RunStatus
from shadowbench.store import Store

_numbers = itertools.count()


def some_run(**fields: Any) -> RunRecord:
    """Return a complete run of the experiment ``quick``."""
    common = {
        "run_id": "20260131-120000-abcd",
        "experiments": ["quick"],
        "argv": ["shadowbench", "run", "quick"],
        "created_at": "2026-01-31T12:00:00+00:00",
        "finished_at": "2026-01-31T12:01:00+00:00",
        "status": RunStatus.COMPLETE,
        "machine": "example cpu, 2 cores",
        "environment": {"python": "3.11", "libraries": {"numpy": "2.4"}},
        "code_version": "0.1.0",
    }
    return RunRecord.model_validate(common | fields)


def some_row(method: str = "pcf", **fields: Any) -> ResultRow:
    """Return a row; of a measured case unless ``outcome`` says otherwise. Every row has a case key of its own."""
    number = next(_numbers)
    common: dict[str, Any] = {
        "run_id": "20260131-120000-abcd",
        "experiment": "quick",
        "case_key": f"{number:020x}",
        "quality_key": f"{number:020x}",
        "scene": "box-on-plane",
        "scene_parameters": {"height": 0.5},
        "method": method,
        "method_parameters": {"resolution": 512},
        "light": "sun",
        "camera": "main",
        "width": 64,
        "height": 48,
        "device": "cpu",
        "threads": 2,
        "outcome": Outcome.OK,
    }
    if fields.get("outcome", Outcome.OK) is Outcome.OK:
        common |= {"dynamic_frame_ms": 3.0, "dynamic_frame_ms_low": 2.9, "dynamic_frame_ms_high": 3.1}
        common |= {"build_ms": 1.0, "shade_ms": 1.5, "failure_percent": 1.25, "failure_count": 10, "scored": 800}
    return ResultRow.model_validate(common | fields)


def with_pictures(store: Store, row: ResultRow, size: tuple[int, int] = (64, 48)) -> ResultRow:
    """Return the row with a noisy result, a mask and a reference (one for all) in the store."""
    seed = int(row.case_key, 16)
    artifacts = {
        "result": store.put_artifact(png(seed, size=size), "png"),
        "failures": store.put_artifact(png(seed, painted=(20, 10), size=size), "png"),
        "reference": store.put_artifact(png(0, size=size), "png"),
    }
    return row.model_copy(update={"artifacts": artifacts})


def with_masks(store: Store, row: ResultRow, **painted: tuple[int, int]) -> ResultRow:
    """Return the row with a mask of one painted pixel (row, column) for each failure class: ``false_lit=(3, 4)``."""
    masks = {f"mask-{name.replace('_', '-')}": store.put_artifact(mask_png(at), "png") for name, at in painted.items()}
    counts = {f"{name}_count": 1 for name in painted}
    return row.model_copy(update={"artifacts": row.artifacts | masks, **counts})


def mask_png(*painted: tuple[int, int], size: tuple[int, int] = (64, 48)) -> bytes:
    """Return a 1-bit picture, white at the pixels (row, column)."""
    pixels = np.zeros(size[::-1], dtype=bool)
    for at in painted:
        pixels[at] = True
    file = io.BytesIO()
    Image.fromarray(pixels).save(file, format="PNG")
    return file.getvalue()


def png(seed: int, *, painted: tuple[int, int] | None = None, size: tuple[int, int] = (64, 48)) -> bytes:
    """Return a picture of grey noise; the pixel (row, column) ``painted`` is orange."""
    generator = np.random.default_rng(seed)
    pixels = np.repeat(generator.integers(0, 255, (size[1], size[0], 1), dtype=np.uint8), 3, axis=2)
    if painted is not None:
        pixels[painted] = (230, 159, 0)
    file = io.BytesIO()
    Image.fromarray(pixels).save(file, format="PNG")
    return file.getvalue()
