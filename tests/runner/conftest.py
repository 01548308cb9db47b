"""A results folder to run small plans in."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from small_runs import Ended, carry_out, planned


@pytest.fixture
def measure(tmp_path: Path) -> Callable[..., Ended]:
    """Return a function that plans and runs methods in one results folder."""
    return lambda *methods, observer=None, **changes: carry_out(planned(tmp_path, *methods, **changes), observer)
