"""Why a receiver fails, in words: from its masks, its true blocker, and what its map could know of it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from shadowbench.metrics import CONTACT_DISTANCE, EDGE_RADIUS

_EDGE = f"edge band: a shadow's edge runs within {EDGE_RADIUS} pixels, where a texel or a filter is too coarse for it"


@dataclass(frozen=True)
class Finding:
    """What is known of a receiver.

    Attributes:
        is_valid: Its surface receives shadows.
        is_in_field: The light reaches it.
        is_turned_away: Its own plane hides it.
        classes: Names of the masks that it is in (:func:`shadowbench.metrics.measure`, and the method's own).
        truth: Hard reference, one number or three.
        result: The method's.
        blocker_distance: Infinite where nothing blocks [scene units].
        diagonal: Of the world [scene units].
    """

    is_valid: bool
    is_in_field: bool
    is_turned_away: bool
    classes: frozenset[str]
    truth: tuple[float, ...]
    result: tuple[float, ...]
    blocker_distance: float
    diagonal: float


def reasons(found: Finding) -> Iterator[str]:
    """Yield sentences that say how the receiver stands and why."""
    if not found.is_valid:
        yield "not scored: its surface receives no shadows"
        return
    if not found.is_in_field:
        yield "not scored: the light does not reach it, so that it is dark by definition"
        return
    if found.is_turned_away:
        lit = "turned_away" in found.classes
        yield "not scored: its surface is turned away from the light" + (", and is shown lit" if lit else "")
        return
    if "false_lit" in found.classes:
        yield "FALSE LIT: the truth is in shadow, the result is lit"
        yield from _of_false_lit(found)
    elif "false_shadow" in found.classes:
        yield "FALSE SHADOW: the truth is lit, the result is in shadow"
        yield from _of_false_shadow(found)
    else:
        difference = float(np.abs(np.subtract(found.result, found.truth)).max())
        side = (
            f"right: on the truth's side of 1/2, off by {difference:.3g}" if difference else "right: equal to the truth"
        )
        yield side
    if "classified" in found.classes:
        yield "the method's own test calls it a failure"


def _of_false_lit(found: Finding) -> Iterator[str]:
    share = found.blocker_distance / found.diagonal
    if "edge_band" in found.classes:
        yield _EDGE
        return
    if "peter_panning" in found.classes:
        yield (
            f"peter-panning: the blocker is near ({share:.2%} of the scene's diagonal, less than "
            f"{CONTACT_DISTANCE:.0%}), and a bias as large as that gap loses it"
        )
        return
    if 0.0 < max(found.result) < 1.0:
        yield f"light leaks: the blocker is {share:.2%} of the scene's diagonal away, and the filter mixes in others"
    else:
        yield (
            f"its blocker, {share:.2%} of the scene's diagonal away, is not what the technique compared with: it may "
            "be thinner than a texel, or lie between texel centres"
        )


def _of_false_shadow(found: Finding) -> Iterator[str]:
    if "edge_band" in found.classes:
        yield _EDGE
    elif "acne" in found.classes:
        yield (
            "acne: no shadow is near, so that a surface shadows itself: what is stored lies nearer to the light than "
            "the receiver by less than a texel's slope; more bias helps"
        )
