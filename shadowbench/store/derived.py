"""Columns that a row has in the database only: short hashes of what is compared with what.

Two rows of one *view* share a picture: scene, light, camera and size. Two rows of one *technique* share the method, its
parameters, what moves, the device and the threads. A leaderboard groups by both, which an index then does.
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
