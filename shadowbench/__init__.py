"""shadowbench: every shadow algorithm against one ray-traced ground truth."""

from __future__ import annotations

__version__ = "0.1.0"
