"""What makes two results the same result: digests of code and content, keys, the machine and its software.

A *quality key* names everything that pixels and counters depend on, a *case key* adds what times depend on. Code enters
a key as the files that a module imports (:mod:`shadowbench.imported_code`): editing any of them changes the keys of
exactly the methods that use it. Nothing here imports Warp or a plugin.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
import os
import platform
import subprocess
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import TYPE_CHECKING, Any

import shadowbench
from shadowbench.imported_code import data_files, imported_files
from shadowbench.machine_state import available_cores as available_cores  # noqa: PLC0414 - everybody's, from here
from shadowbench.machine_state import load_average, settings

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

_KEY_LENGTH = 20
"""Hex digits of a key: 80 bits, so that a million results meet by chance once in 10^12 collections."""

_LIBRARIES = (
    *("numpy", "scipy", "warp-lang", "pyvista", "vtk", "flip-evaluator", "embreex", "moderngl", "pandas", "sqlalchemy"),
)


def key_of(content: Mapping[str, Any] | Sequence[Any]) -> str:
    """Return a short digest of a JSON value; the order of keys does not matter."""
    text = json.dumps(content, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()[:_KEY_LENGTH]


def file_digest(file: Path) -> str:
    """Return a digest of a file's content.

    Raises:
        OSError: The file cannot be read.
    """
    with file.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()[:_KEY_LENGTH]


def visibility_digest(visibility: NDArray[np.float32], valid: NDArray[np.bool_]) -> str:
    """Return a digest of the bits of a result: equal digests, equal visibility.

    Args:
        visibility: Of every receiver, shape [n] or [n, 3].
        valid: The receivers that count, shape [n].
    """
    seen = visibility if valid.all() else visibility[valid]
    return hashlib.blake2b(seen.tobytes(), digest_size=_KEY_LENGTH // 2).hexdigest()


def content_digest(value: Any) -> str:
    """Return a digest of dataclasses, collections, plain values and NumPy arrays: the same on every machine."""
    digest = hashlib.blake2b(digest_size=_KEY_LENGTH // 2)
    for part in _content_parts(value):
        digest.update(part)
    return digest.hexdigest()


def _content_parts(value: Any) -> Iterator[bytes | memoryview]:
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        yield f"{type(value).__name__}(".encode()
        for field in dataclasses.fields(value):
            yield f"{field.name}=".encode()
            yield from _content_parts(getattr(value, field.name))
        yield b")"
    elif isinstance(value, Mapping):
        yield f"{{{len(value)}".encode()
        for key, item in value.items():
            yield f"{key!r}:".encode()
            yield from _content_parts(item)
    elif isinstance(value, tuple | list):
        yield f"[{len(value)}".encode()
        for item in value:
            yield from _content_parts(item)
    elif hasattr(value, "__array_interface__"):
        yield f"{value.dtype.str}{value.shape}".encode()
        yield memoryview(value.reshape(-1).view("u1"))
    else:
        yield f"{value!r};".encode()


def code_digest(module: str) -> str:
    """Return a digest of a module's source, of its own code that it imports, and of the data files that it names.

    Args:
        module: Full name of a module that could be imported, or of a plugin file that was.

    Raises:
        ModuleNotFoundError: There is no such module.
    """
    files = imported_files(module)
    for name, file in list(files.items()):
        files |= data_files(name, file)
    return key_of({name: _digest_of(file, file.stat().st_mtime_ns) for name, file in files.items()})


@cache
def _digest_of(file: Path, _modified: int) -> str:
    return file_digest(file)


def machine() -> str:
    """Return the machine key, for people to read: processor, cores, memory, operating system."""
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    cores = os.cpu_count() or 1
    count = f"{cores} core" + ("s" if cores > 1 else "")
    return f"{_processor()}, {count}, {memory / 2**30:.0f} GiB, {platform.system()} {platform.machine()}"


def _processor() -> str:
    try:
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            name, _, value = line.partition(":")
            if name.strip() in ("model name", "Model"):
                return " ".join(value.split())
    except OSError:
        pass
    return platform.processor() or platform.machine()


def environment() -> dict[str, Any]:
    """Return versions, hardware and how it is set, for the record of a run; only what is known."""
    return {
        "python": f"{platform.python_version()} ({platform.python_implementation()})",
        "system": platform.platform(),
        "processor": _processor(),
        "cores": os.cpu_count() or 1,
        "available_cores": available_cores(),
        **settings(),
        "load_average": load_average(),
        "code": checkout_of(Path(shadowbench.__file__)),
        "libraries": {name: found for name in _LIBRARIES if (found := library_version(name))},
    }


def plugin_origin(file: Path) -> dict[str, Any]:
    """Return where a plugin file's code is from: its digest, and its commit where it lies in a checkout."""
    try:
        digest = file_digest(file)
    except OSError:
        return {}
    return {"digest": digest} | checkout_of(file)


def checkout_of(file: Path) -> dict[str, Any]:
    """Return the commit of the git checkout that holds a file, and whether tracked files differ from it.

    Empty for a file that is in none, or that git does not track.
    """
    folder = file.resolve().parent
    if not _git(folder, "ls-files", "--", file.name):
        return {}
    commit = _git(folder, "rev-parse", "--short=10", "HEAD")
    if not commit:
        return {}
    changed = _git(folder, "status", "--porcelain", "--untracked-files=no")
    return {"commit": commit, "changed": bool(changed)}


def library_version(distribution: str) -> str | None:
    """Return an installed distribution's version without importing it."""
    try:
        return version(distribution)
    except PackageNotFoundError:
        return None


def code_version() -> str:
    """Return shadowbench's version and, in a checkout, its commit and whether files differ from it."""
    found = checkout_of(Path(shadowbench.__file__))
    if not found:
        return shadowbench.__version__
    return f"{shadowbench.__version__}+{found['commit']}" + (".changed" if found["changed"] else "")


def _git(folder: Path, *arguments: str) -> str:
    try:
        done = subprocess.run(
            ["git", "-C", str(folder), *arguments],  # noqa: S607 - the user's git
            capture_output=True, text=True, timeout=10, check=False,
        )  # fmt: skip
    except (OSError, subprocess.TimeoutExpired):
        return ""
    return done.stdout.strip() if done.returncode == 0 else ""
