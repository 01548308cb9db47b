"""A PostgreSQL server of one's own for a test session: reached through a socket in a temporary folder, then gone.

Needs the programs of Debian's package ``postgresql``. Where they are missing the tests that ask for it are skipped,
except in CI, which sets ``SHADOWBENCH_NEED_POSTGRESQL``.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

_SETTINGS = {"listen_addresses": "''", "shared_buffers": "64MB", "max_connections": "400"}
_FORGETFUL = {"fsync": "off", "full_page_writes": "off", "synchronous_commit": "off"}
"""What a power cut could cost does not matter to tests."""


@contextmanager
def running(*, durable: bool = False) -> Iterator[str]:
    """Start a server and yield the address of its databases, up to the name: ``postgresql://…?…`` with ``{}``.

    Args:
        durable: Let each commit reach the disk, as a group's server does.
    """
    folder = start(durable=durable)
    try:
        yield address_of(folder)
    finally:
        stop(folder)


def start(*, durable: bool = False) -> Path:
    """Start a server as :func:`running` does, which outlives this process, and return its folder."""
    if not _programs():
        reason = "PostgreSQL's server is not installed (Debian: apt-get install postgresql)"
        if os.environ.get("SHADOWBENCH_NEED_POSTGRESQL"):
            pytest.fail(reason)
        pytest.skip(reason)
    folder = Path(tempfile.mkdtemp(prefix="shadowbench-postgresql-"))
    if os.geteuid() == 0:
        shutil.chown(folder, "postgres", "postgres")
    cluster = str(folder / "cluster")
    _call(folder, "initdb", "-D", cluster, "-U", "shadowbench", "-A", "trust", "-E", "UTF8", "--locale=C.UTF-8")
    chosen = _SETTINGS if durable else _SETTINGS | _FORGETFUL
    settings = " ".join(f"-c {name}={value}" for name, value in chosen.items())
    options = f"-k {folder} {settings}"
    _call(folder, "pg_ctl", "-D", cluster, "-w", "-l", str(folder / "log"), "-o", options, "start")
    return folder


def address_of(folder: Path) -> str:
    """Return the address of a server's databases."""
    return f"postgresql://shadowbench@/{{}}?host={folder}"


def stop(folder: Path) -> None:
    """End a server and remove what it kept."""
    _call(folder, "pg_ctl", "-D", str(folder / "cluster"), "-w", "-m", "immediate", "stop")
    shutil.rmtree(folder)


def _programs() -> list[Path]:
    return sorted(Path("/usr/lib/postgresql").glob("*/bin"), key=lambda path: int(path.parent.name))


def _call(folder: Path, program: str, *arguments: str) -> None:
    by_somebody = ("runuser", "-u", "postgres", "--") if os.geteuid() == 0 else ()  # it refuses to run as root
    command = [*by_somebody, str(_programs()[-1] / program), *arguments]
    subprocess.run(command, check=True, cwd=folder, stdout=subprocess.DEVNULL)
