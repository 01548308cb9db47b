"""What ``doctor`` looks at, one function a check. Nothing here changes anything.

Libraries that could take the process down with them (graphics drivers, extension modules) are tried in a child
process.
"""

from __future__ import annotations

import ctypes.util
import os
import platform
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

from shadowbench.cli.machine_noise import DEFAULT_ROUNDS, PROCESSES, Sampler, measured_noise
from shadowbench.identity import available_cores, code_version, library_version, machine
from shadowbench.machine_state import governors, throttle_count, turbo, usable_cores

_GIB = 2**30
_CHILD_SECONDS = 60.0
_NOISY = 0.05
"""Differences of up to this that a comparison cannot show call for a warning."""

CORE_PACKAGES = (
    "numpy",
    "warp-lang",
    "pyvista",
    "pandas",
    "pydantic",
    "sqlalchemy",
    "alembic",
    "jinja2",
    "pillow",
    "psutil",
    "rich",
    "tabulate",
    "typer",
)


class State(StrEnum):
    """How a check ended."""

    OK = "ok"
    WARN = "warn"
    FAIL = "fail"


@dataclass(frozen=True)
class Check:
    """A finding.

    Attributes:
        name: What was looked at.
        state: ``fail`` where shadowbench cannot work without it, ``warn`` where something is lost.
        found: What there is.
        remedy: What to do about it; empty for ``ok``.
    """

    name: str
    state: State
    found: str
    remedy: str = ""


def all_checks(results: Path) -> Iterator[Check]:
    """Yield every finding; ``results`` is the results folder that would be used."""
    looks: tuple[Callable[[], Check], ...] = (
        versions,
        processor,
        load,
        noise,
        frequency,
        memory,
        warp,
        kernel_cache,
        lambda: results_folder(results),
        graphics,
        lambda: peer("embreex", "embree", "import embreex.rtcore_scene"),
        lambda: peer("moderngl", "opengl-*", _OPENGL),
    )
    for look in looks:
        try:
            yield look()
        except Exception as error:  # noqa: BLE001 - a doctor does not fall ill
            name = getattr(look, "__name__", "check")
            yield Check(name, State.WARN, f"cannot be looked at: {error}", "please report it")


def versions() -> Check:
    """Look at the interpreter and at the packages that everything needs."""
    found = {name: library_version(name) for name in CORE_PACKAGES}
    missing = [name for name, known in found.items() if known is None]
    if missing:
        return Check("versions", State.FAIL, f"missing: {', '.join(missing)}", f"pip install {' '.join(missing)}")
    python = f"shadowbench {code_version()}, Python {platform.python_version()}"
    return Check("versions", State.OK, ", ".join([python, *(f"{name} {known}" for name, known in found.items())]))


def processor() -> Check:
    """Look at the processor and at how much of it this process may use."""
    usable = usable_cores()
    found = f"{machine()}; this process may use {usable:g}"
    if usable < 2:
        return Check("processor", State.WARN, found, "with one core, other programs disturb every measurement")
    return Check("processor", State.OK, found)


def frequency() -> Check:
    """Look at what changes the cores' frequency."""
    found = governors()
    words = [f"governor {', '.join(found)}" if found else "no governor is visible (a virtual machine hides it)"]
    if turbo() is not None:
        words.append("turbo on" if turbo() else "turbo off")
    throttled = throttle_count()
    if throttled is not None:
        words.append(f"slowed down for heat {throttled} times since the start")
    if any(governor != "performance" for governor in found):
        remedy = "`cpupower frequency-set -g performance` keeps cores from following the load"
        return Check("frequency", State.WARN, ", ".join(words), remedy)
    return Check("frequency", State.OK, ", ".join(words))


def noise(sampler: Sampler | None = None) -> Check:
    """Measure a calculation against itself, and say what to expect of comparisons."""
    seen = measured_noise(sampler)
    smallest = seen.smallest_difference(DEFAULT_ROUNDS, PROCESSES)
    found = (
        f"{seen.of_rounds:.1%} from round to round, {seen.of_processes:.1%} from process to process: "
        f"{DEFAULT_ROUNDS} rounds in {PROCESSES} processes show differences from about {smallest:.1%} on"
    )
    finer = smallest / 2.0
    rounds = seen.rounds_for(finer, PROCESSES)
    if rounds is not None and rounds > DEFAULT_ROUNDS:
        found += f", smaller ones need more: {finer:.1%} about {rounds}"
    elif smallest > 0.0:
        found += ", smaller ones need more processes"
    if smallest > _NOISY:
        return Check("noise", State.WARN, found, "end other programs, or measure when the machine is quiet")
    return Check("noise", State.OK, found)


def load() -> Check:
    """Look at what else is running."""
    busy, usable = os.getloadavg()[0], available_cores()
    found = f"{busy:.1f} of {usable} cores busy"
    if busy > 0.5 * usable:
        return Check("load", State.WARN, found, "end other programs before measuring")
    return Check("load", State.OK, found)


def memory() -> Check:
    """Look at main memory."""
    import psutil

    sizes = psutil.virtual_memory()
    found = f"{sizes.available / _GIB:.1f} of {sizes.total / _GIB:.1f} GiB available"
    if sizes.available < 2 * _GIB:
        return Check("memory", State.WARN, found, "large scenes may end as out-of-memory: end other programs")
    return Check("memory", State.OK, found)


def warp() -> Check:
    """Start Warp and name its devices."""
    ended = _child("import warp as wp; wp.init(); print('\\n', *(f'{d.alias} ({d.name})' for d in wp.get_devices()))")
    if ended.returncode != 0:
        return Check("Warp", State.FAIL, _last_line(ended.stderr), "pip install --force-reinstall warp-lang")
    return Check("Warp", State.OK, f"devices: {_last_line(ended.stdout)}")


def kernel_cache() -> Check:
    """Look at the folder where Warp keeps compiled kernels."""
    ended = _child("import warp as wp; wp.init(); print(); print(wp.config.kernel_cache_dir)")
    if ended.returncode != 0:
        return Check("kernel cache", State.FAIL, _last_line(ended.stderr), "see Warp above")
    folder = Path(_last_line(ended.stdout))
    if not _can_write(folder):
        return Check("kernel cache", State.FAIL, f"{folder}: not writable", "set WARP_CACHE_PATH to a folder of yours")
    size = sum(file.stat().st_size for file in folder.rglob("*") if file.is_file()) if folder.exists() else 0
    return Check("kernel cache", State.OK, f"{folder}, {size / 2**20:.0f} MiB")


def results_folder(folder: Path) -> Check:
    """Look at the results folder, or at where it would be made."""
    place = next(p for p in (folder.absolute(), *folder.absolute().parents) if p.exists())
    if not place.is_dir() or not _can_write(place):
        return Check("results folder", State.FAIL, f"{folder} cannot be written", "choose another with --results")
    free = shutil.disk_usage(place).free
    found = f"{folder}, {free / _GIB:.1f} GiB free"
    if _file_system(place) in ("nfs", "nfs4", "cifs", "smb3", "fuse.sshfs"):
        return Check("results folder", State.WARN, f"{found}, on a network", "SQLite needs a local disk: use --results")
    if free < _GIB:
        return Check("results folder", State.WARN, found, "free some space, or use --results")
    return Check("results folder", State.OK, found)


def graphics() -> Check:
    """Look for the libraries with which VTK and OpenGL draw without a window."""
    found = [name for name in ("EGL", "OSMesa", "GL") if ctypes.util.find_library(name)]
    if not {"EGL", "OSMesa"} & set(found):
        return Check(
            "libEGL", State.WARN, "not found; only the methods opengl-* need it", "apt install libegl1 libgl1-mesa-dri"
        )
    return Check("libEGL", State.OK, ", ".join(f"lib{name}" for name in found))


_OPENGL = "import moderngl; c = moderngl.create_standalone_context(backend='egl'); print(c.info['GL_RENDERER'])"


def peer(package: str, method: str, code: str) -> Check:
    """Try a library of the extra ``peers``."""
    installed = library_version(package)
    if installed is None:
        found = f"not installed; method '{method}' is skipped"
        return Check(package, State.WARN, found, "pip install 'shadowbench[peers]'")
    found = f"{package} {installed}"
    ended = _child(code)
    if ended.returncode != 0:
        return Check(package, State.WARN, f"{found}, but: {_last_line(ended.stderr)}", f"method '{method}' is skipped")
    said = _last_line(ended.stdout)
    return Check(package, State.OK, f"{found}, {said}" if said else found)


def _child(code: str) -> subprocess.CompletedProcess[str]:
    """Run Python code in a process of its own."""
    try:
        return subprocess.run(
            [sys.executable, "-c", code], capture_output=True, text=True, timeout=_CHILD_SECONDS, check=False
        )
    except subprocess.TimeoutExpired:
        return subprocess.CompletedProcess([], 1, "", f"no answer within {_CHILD_SECONDS:.0f} s")


def _last_line(text: str) -> str:
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    return lines[-1] if lines else ""


def _can_write(folder: Path) -> bool:
    """Try it where there is a folder; permissions alone do not tell on every file system."""
    place = next(p for p in (folder, *folder.parents) if p.exists())
    try:
        with tempfile.TemporaryFile(dir=place):
            return True
    except OSError:
        return False


def _file_system(folder: Path) -> str:
    """Return the type of the file system that holds ``folder``."""
    import psutil

    mounts = [m for m in psutil.disk_partitions(all=True) if folder.resolve().is_relative_to(m.mountpoint)]
    return max(mounts, key=lambda m: len(m.mountpoint)).fstype if mounts else ""
