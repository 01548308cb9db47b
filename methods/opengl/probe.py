"""Whether there is an OpenGL here, and which: asked once, in a child process.

A graphics driver that does not fit the machine may end the process that tries it. So a child tries it, which takes a
tenth of a second on llvmpipe, and what it says is remembered for as long as this process lives.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from importlib.metadata import PackageNotFoundError, version

_LONGEST_S = 30.0
"""A driver that has not answered by then will not."""

_MARK = "found: "

_CHILD = f"""
import json
import moderngl
gl = moderngl.create_context(standalone=True, backend="egl", require=330)
names = {{"renderer": "GL_RENDERER", "version": "GL_VERSION", "largest_texture": "GL_MAX_TEXTURE_SIZE"}}
print({_MARK!r} + json.dumps({{name: gl.info[key] for name, key in names.items()}}), flush=True)
"""

_REMEDY = "it needs EGL and a driver (Debian: apt install libegl1 libgl1-mesa-dri)"


@dataclass(frozen=True)
class Found:
    """What the child found.

    Attributes:
        reason: Why OpenGL cannot be used here; empty if it can.
        renderer, version: What OpenGL calls itself.
        largest_texture: Width and height that a texture can have [texels].
    """

    reason: str = ""
    renderer: str = ""
    version: str = ""
    largest_texture: int = 0


@cache
def probe() -> Found:
    """Return what OpenGL there is. Never raises."""
    try:
        version("moderngl")
    except PackageNotFoundError:
        return Found("moderngl is not installed: pip install 'shadowbench[peers]'")
    try:
        ended = subprocess.run(
            [sys.executable, "-c", _CHILD],
            capture_output=True, text=True, errors="replace", timeout=_LONGEST_S, check=False, stdin=subprocess.DEVNULL,
            env=os.environ | {"LP_NUM_THREADS": "0"},
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        return Found(f"OpenGL gives no answer within {_LONGEST_S:g} s; {_REMEDY}")
    except OSError as error:
        return Found(f"OpenGL cannot be tried: {error}")
    for line in ended.stdout.splitlines():
        if line.startswith(_MARK):
            with suppress(ValueError, TypeError, KeyError):
                said = json.loads(line.removeprefix(_MARK))
                return Found("", said["renderer"], said["version"], int(said["largest_texture"]))
    return Found(f"no OpenGL without a window here ({_how(ended)}); {_REMEDY}")


def _how(ended: subprocess.CompletedProcess[str]) -> str:
    """Return how a child failed: by which signal, or the last line it wrote."""
    if ended.returncode < 0:
        with suppress(ValueError):
            return f"trying it ends by {signal.Signals(-ended.returncode).name}"
    lines = [line.strip() for line in ended.stderr.splitlines() if line.strip()]
    return lines[-1] if lines else f"trying it ends with status {ended.returncode}"
