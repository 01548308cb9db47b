"""shadowbench: every shadow algorithm against one ray-traced ground truth.

For notebooks: ``shadowbench.load_results("shadowbench-results")`` gives a run's rows as a pandas DataFrame.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from shadowbench.tables.frames import load_results as load_results

__version__ = "0.1.0"

__all__ = ["__version__", "load_results"]


def __getattr__(name: str) -> Any:
    if name == "load_results":  # lazily: pandas and the store are heavy, and this package is imported by everything
        from shadowbench.tables.frames import load_results

        return load_results
    raise AttributeError(f"module 'shadowbench' has no attribute '{name}'")
