"""Reading through a foreign library in a process of its own.

VTK and USD are large C++ libraries: on a damaged file they may write pages to the error stream, or end the process.
Here that costs the user one line. The child (``__main__``) writes the polygons, or the error's text, into a folder that
lives as long as the call.
"""

from __future__ import annotations

import signal
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from shadowbench.errors import SceneError

from .polygons import Polygons
from .words import quoted

POLYGONS_FILE, ERROR_FILE = "polygons.npz", "error.txt"
_REMEDY = "it is damaged: export it again, for instance as PLY"


def read_isolated(reader: str, path: Path) -> Polygons:
    """Read ``path`` with ``shadowbench.scenes.formats.<reader>`` in a child process.

    Raises:
        SceneError: The reader's own, or one that says how the child ended or what it complained about.
    """
    with tempfile.TemporaryDirectory(prefix="shadowbench-mesh-") as name:
        folder = Path(name)
        # -P: a file of the user's working folder must not pass for a module
        command = [sys.executable, "-P", "-W", "ignore", "-m", __package__, reader, str(path), name]
        done = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, check=False)
        if (folder / ERROR_FILE).exists():
            raise SceneError((folder / ERROR_FILE).read_text(encoding="utf-8"))
        complaint = _complaint(done.stderr.decode("utf-8", "replace")) if reader == "vtk" else None
        if complaint is not None:
            raise SceneError(f"{path}: VTK says: {complaint}; {_REMEDY}")
        if done.returncode != 0:
            raise SceneError(f"{path}: the {reader.upper()} reader {_ending(done.returncode)}; {_REMEDY}")
        with np.load(folder / POLYGONS_FILE) as arrays:
            return Polygons(
                arrays["vertices"],
                arrays["corner_counts"],
                arrays["corners"],
                str(arrays["up"]) or None,
                tuple(arrays["notes"].tolist()),
            )


def _ending(returncode: int) -> str:
    if returncode < 0:
        return f"crashed ({signal.Signals(-returncode).name})"
    return f"failed (exit status {returncode})"


def _complaint(stderr: str) -> str | None:
    """Return the first error that VTK wrote, without its source positions; one without addresses if there is one."""
    complaints = []
    for line in stderr.splitlines():
        # VTK's log lines, and pyvista's repetitions of what it does not log itself
        if "ERR|" in line or ("rror" in line and ("WARN|" in line or line.startswith("ERROR:"))):
            text = line.rpartition("|")[2].replace("\x1b[0m", "")
            complaints.append(quoted(text.rpartition("): ")[2], 160))
    return min(complaints, key=lambda text: "(0x" in text, default=None)
