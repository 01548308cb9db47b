"""What one sample is: how often a short frame is repeated in it, and how many frames go before the first one.

Both are found once a case, outside the clock. A sample is divided by its repeats, so it is always the time of one
frame.
"""

from __future__ import annotations

import math
import time

LEAST_SAMPLE_MS = 1.0
"""Shorter ones are repeated until they last this long: some thousand times what reading the clock and calling take."""

MOST_REPEATS = 100
"""Of what does next to nothing: its time is then the call's."""

WARM_BELOW_MS = 25.0
"""A frame shorter than this runs once untimed in its round: what it needs was evicted while other workers ran."""

_STILL_FALLING = 0.95
_MOST_FRAMES = 10
_MOST_MS = 2000.0


def repeats_for(duration_ms: float) -> int:
    """Return how often something of this duration is repeated within a sample."""
    resolution_ms = time.get_clock_info("perf_counter").resolution * 1.0e3
    least_ms = max(LEAST_SAMPLE_MS, 1.0e3 * resolution_ms)
    return MOST_REPEATS if duration_ms * MOST_REPEATS <= least_ms else max(1, math.ceil(least_ms / duration_ms))


class WarmUp:
    """Frames before the first sample: until one is no longer 5 % faster than the one before, within bounds.

    The bounds are ten frames and two seconds; a frame that alone takes longer is not repeated, since the first round is
    its first repeat.

    Attributes:
        frames: How many there were.
    """

    def __init__(self) -> None:
        self.frames = 0
        self._total_ms, self._last_ms = 0.0, math.inf
        self._is_steady = False

    def add(self, frame_ms: float) -> None:
        """Take note of a frame."""
        self.frames += 1
        self._is_steady = frame_ms >= _STILL_FALLING * self._last_ms
        self._total_ms += frame_ms
        self._last_ms = frame_ms

    @property
    def is_over(self) -> bool:
        """Whether the first sample may be taken."""
        return self._is_steady or self.frames >= _MOST_FRAMES or self._total_ms > _MOST_MS
