"""No shadows: every receiver is lit. What other techniques' costs and failures are measured from.

A frame takes the camera pass and one write a receiver; whatever more another technique takes, its shadows cost. Failure
is then the share of scored receivers that lie in shadow: no technique that fails as often is worth its time.

Limits: all of them. Cost: the memory's speed, 4 bytes a receiver (12 where casters have a coloured transmittance).
"""

from __future__ import annotations

from typing import Any

import warp as wp

from shadowbench.account import Account, Step
from shadowbench.method import Changes, Method, Trace, View
from shadowbench.receivers import Receivers
from shadowbench.scene import Light
from shadowbench.world import Casters


class NoShadows(Method):
    """Light everywhere."""

    name = "no-shadows"
    title = "No shadows"

    def build(self, casters: Casters, light: Light, view: View, changes: Changes, trace: Trace) -> None:
        """Do nothing: there is nothing to prepare."""

    def shade(self, receivers: Receivers, visibility: wp.array[Any], trace: Trace) -> None:
        with trace.stage("fill"):
            visibility.fill_(1.0)

    def account(self, receivers: Receivers, index: int) -> Account:
        return Account((Step("nothing is tested", formula=("visibility = 1",)),), 1.0)
