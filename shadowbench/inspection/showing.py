"""Shows a case in space: in a window or a picture, drawn by a child process that may fail, or in a page."""

from __future__ import annotations

import ctypes.util
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from shadowbench.errors import UsageError
from shadowbench.inspection.drawing import WINDOW
from shadowbench.inspection.page import page
from shadowbench.inspection.space import Arrays

PICTURES = (".png", ".jpg", ".jpeg")

_REMEDY = "install one (apt install libegl1 libgl1-mesa-dri, or libosmesa6)"
_LONGEST_S = 600.0


def must_be_possible(target: Path | None) -> None:
    """Say why a target cannot be drawn, before anything is computed.

    Raises:
        UsageError: There is no display, no library to render with, or no extra to export with.
    """
    if target is None:
        if not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")) and sys.platform == "linux":
            raise UsageError("there is no display for a window; write a picture or a page: -o view.png, -o view.html")
        return
    suffix = target.suffix.lower()
    if suffix == ".html":
        return  # the browser renders
    if suffix not in PICTURES:
        raise UsageError(f"{target}: write .png, .jpg or .html")
    if sys.platform == "linux" and not any(map(ctypes.util.find_library, ("EGL", "OSMesa"))):
        raise UsageError(f"{target}: neither libEGL nor libOSMesa is there to render with; {_REMEDY}")


def show(arrays: Arrays, described: dict[str, Any], target: Path | None) -> None:
    """Write a page, or draw in a child process.

    Args:
        arrays, described: As :func:`shadowbench.inspection.space.laid_out` returns them.
        target: A .png, .jpg or .html file; ``None`` for a window.

    Raises:
        UsageError: It cannot be drawn or written.
    """
    if target is not None and target.suffix.lower() == ".html":
        _write(target, page(arrays, described).encode())
        return
    with tempfile.TemporaryDirectory(prefix="shadowbench-view-") as folder:
        source = Path(folder) / "case.npz"
        held: dict[str, Any] = {"described": np.array(json.dumps(described)), **arrays}
        np.savez(source, **held)
        drawn = Path(folder) / f"drawn{'' if target is None else target.suffix.lower()}"
        command = [sys.executable, "-m", "shadowbench.inspection.drawing", str(source)]
        command.append(WINDOW if target is None else str(drawn))
        try:
            done = subprocess.run(
                command,
                capture_output=True,
                text=True,
                errors="replace",
                check=False,
                timeout=None if target is None else _LONGEST_S,
            )
        except subprocess.TimeoutExpired:
            raise UsageError(f"drawing took longer than {_LONGEST_S:.0f} s and was stopped") from None
        if done.returncode < 0:
            raise UsageError(f"VTK ended with signal {-done.returncode}: it cannot render here; {_REMEDY}")
        if done.returncode != 0 or (target is not None and not drawn.is_file()):
            last = next((line for line in reversed(done.stderr.splitlines()) if line.strip()), "no reason given")
            raise UsageError(f"it cannot be drawn: {last.strip()}")
        if target is not None:
            _write(target, drawn.read_bytes())


def _write(target: Path, content: bytes) -> None:
    try:
        target.write_bytes(content)
    except OSError as error:
        raise UsageError(f"--output {target}: {error.strerror}") from error
