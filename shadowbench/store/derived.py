"""What the database has of rows beside their own columns: hashes of what is compared with what, and leaderboards.

Two rows of one *view* share a picture: scene, light, camera and size. Two rows of one *technique* share the method, its
parameters, what moves, the device and the threads. Both are columns, short hashes. A *standing* is what a leaderboard
shows of a technique in a view, on a machine and with a version: some columns of the newest row of these.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from typing import Any

VIEW_FIELDS = ("scene", "scene_parameters", "light", "camera", "width", "height", "pixel_samples", "layers", "moving")
"""What rows must share for their measures to be compared."""

TECHNIQUE_FIELDS = ("method", "method_parameters", "moving", "device", "threads")
"""What makes a line of a leaderboard."""

MEASURES = ("failure_percent", "false_lit_percent", "false_shadow_percent", "acne_percent", "peter_panning_percent")
"""What a technique gets wrong: the same on every machine."""

LIKENESSES = ("rmse", "ssim", "flip", "leak_mean")

TIMES = ("build_ms", "shade_ms", "static_frame_ms", "dynamic_frame_ms")
"""What it costs: compared on one machine only."""

STANDING_KEY = ("experiment", "view_key", "code_version", "machine", "technique_key")
"""What has one standing."""

_PLACE = ("run_id", "case_key", "technique_key", "machine", "code_version", "measured_at", "outcome", "reason")
QUALITY_COLUMNS = (*_PLACE, "visibility_digest", *MEASURES, *LIKENESSES)
TIME_COLUMNS = (*_PLACE, "bytes_kept", *(f"{time}{end}" for time in TIMES for end in ("", "_low", "_high")))

STANDING_COLUMNS = tuple(dict.fromkeys(name for name in (*QUALITY_COLUMNS, *TIME_COLUMNS) if name not in STANDING_KEY))
"""Columns of the row that a standing has copies of."""


def derived_values(values: Mapping[str, Any]) -> dict[str, str]:
    """Return the derived columns of a row.

    Args:
        values: The row's own columns as JSON values.
    """
    return {
        "view_key": _hash([values[name] for name in VIEW_FIELDS]),
        "technique_key": _hash([values[name] for name in TECHNIQUE_FIELDS]),
    }


def _hash(content: list[Any]) -> str:
    text = json.dumps(content, sort_keys=True, ensure_ascii=True)
    return hashlib.sha256(text.encode("ascii")).hexdigest()[:16]
