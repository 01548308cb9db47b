"""Compiling kernels before anything is timed, on all cores.

Warp compiles a module when one of its kernels is first launched, one after the other. Here the modules of everything
a comparison will use are compiled side by side; the compiled code lies in Warp's own cache afterwards, from where each
worker loads it in milliseconds.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import warp as wp

from shadowbench.identity import available_cores
from shadowbench.imported_code import imported_files


def load_kernels(modules: Iterable[str], device: str) -> dict[str, float]:
    """Compile the kernels that Python modules use, or load them from Warp's cache.

    Args:
        modules: Names of imported modules; the shadowbench modules that they import count as theirs.
        device: Where to load them.

    Returns:
        Duration by Warp module [ms]; modules compiled side by side share the cores.

    Raises:
        Exception: Whatever Warp raises for a kernel that cannot be compiled.
    """
    wanted = {
        value.module.name: value.module
        for module in modules
        for name in imported_files(module)
        for value in vars(sys.modules.get(name, object)).values()
        if isinstance(value, wp.Kernel) and not value.is_generic
    }

    def load(module: Any) -> float:
        begin = time.perf_counter()
        wp.force_load(device, modules=[module])
        return (time.perf_counter() - begin) * 1.0e3

    with ThreadPoolExecutor(available_cores()) as executor:
        return dict(zip(wanted, executor.map(load, wanted.values()), strict=True))
