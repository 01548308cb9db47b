"""Computing a published case again, and what is not as published."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from shadowbench.errors import UsageError
from shadowbench.inspection.opening import OpenCase, open_case
from shadowbench.rows import ResultRow

_COUNTS = ("receivers", "scored", "failure_count", "false_lit_count", "false_shadow_count")

TOLERANCE = 1
"""How far a filtered visibility may lie off, of 255."""


def levels(opened: OpenCase) -> NDArray[np.uint8]:
    """Return a case's visibility by pixel, 0 to 255: shape [height, width], or [height, width, 3] by channel."""
    valid = opened.seen.receivers.valid
    visibility = opened.visibility.reshape(len(valid), -1)
    seen = np.where(valid[:, None], visibility, 0.0)
    picture = opened.seen.receivers.picture(seen if seen.shape[1] > 1 else seen[:, 0])
    return np.rint(np.clip(picture, 0.0, 1.0) * 255.0).astype(np.uint8)


def computed_levels(row: ResultRow, cache: Path) -> NDArray[np.uint8]:
    """Run a case of a run that is to be published once more and return its :func:`levels`.

    Args:
        row: The case's.
        cache: A results folder, whose cache keeps scenes and truths.

    Raises:
        UsageError: Hard visibility has other bits than when the run was measured.
        ShadowbenchError: The case cannot be computed.
    """
    opened = open_case(row, cache, tell_changes=False)
    if opened.digest != row.visibility_digest and row.reference_error is None:
        raise UsageError(
            f"run {row.run_id} cannot be published: case {row.case_key} ({row.method} on {row.scene}) gives other"
            " visibility than when it was measured; measure it again"
        )
    return levels(opened)


def differences(row: ResultRow, published: NDArray[np.uint8], cache: Path) -> list[str]:
    """Compute a published case again and return what is not as published, a line each; none if nothing moved.

    Args:
        row: As published.
        published: Its visibility, as :func:`levels` returns it.
        cache: A results folder, whose cache keeps scenes and truths.

    Raises:
        ShadowbenchError: The case cannot be computed.
    """
    opened = open_case(row, cache, tell_changes=False)
    found = _changed("counter", row.counters, opened.trace.counters)
    found += _changed("bytes kept for", row.kept, opened.trace.bytes_by_name())
    is_filtering = row.reference_error is not None
    if opened.digest == row.visibility_digest:
        return found
    if not is_filtering:
        now = {name: opened.measured.columns[name] for name in _COUNTS if name in opened.measured.columns}
        found += _changed("", {name: getattr(row, name) for name in now}, now)
        return [*found, "hard visibility has other bits"]
    again = levels(opened)
    if again.shape != published.shape:
        return [*found, f"visibility has shape {again.shape}, was {published.shape}"]
    off = np.abs(again.astype(np.int16) - published.astype(np.int16))
    if off.max(initial=0) > TOLERANCE:
        count = int((off.reshape(*off.shape[:2], -1).max(axis=2) > TOLERANCE).sum())
        found.append(f"filtered visibility differs by up to {int(off.max())}/255, by more than 1/255 in {count} pixels")
    return found


def _changed(what: str, before: Mapping[str, int | None], now: Mapping[str, int | None]) -> list[str]:
    names = dict.fromkeys([*before, *now])
    label = f"{what} " if what else ""
    return [
        f"{label}'{name}' is {now.get(name, 'absent')}, was {before.get(name, 'absent')}"
        for name in names
        if before.get(name) != now.get(name)
    ]
