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

_SETTINGS = {"listen_addresses": "''", "shared_buffers": "64MB", "max_connections": "200"}
_FORGETFUL = {"fsync": "off", "full_page_writes": "off", "synchronous_commit": "off"}
"""What a power cut could cost does not matter to tests."""


@contextmanager
def running(*, durable: bool = False) -> Iterator[str]:
    """Start a server and yield the address of its databases, up to the name: ``postgresql://…?…`` with ``{}``.

    Args:
        durable: Let each commit reach the disk, as a group's server does.
    """
    programs = sorted(Path("/usr/lib/postgresql").glob("*/bin"), key=lambda path: int(path.parent.name))
    if not programs:
        reason = "PostgreSQL's server is not installed (Debian: apt-get install postgresql)"
        if os.environ.get("SHADOWBENCH_NEED_POSTGRESQL"):
            pytest.fail(reason)
        pytest.skip(reason)
    folder = Path(tempfile.mkdtemp(prefix="shadowbench-postgresql-"))
    by_somebody: tuple[str, ...] = ()
    if os.geteuid() == 0:  # the server refuses to run as root
        shutil.chown(folder, "postgres", "postgres")
        by_somebody = ("runuser", "-u", "postgres", "--")
    bin_folder = programs[-1]

    def call(*command: str) -> None:
        subprocess.run([*by_somebody, *command], check=True, cwd=folder, stdout=subprocess.DEVNULL)

    cluster = str(folder / "cluster")
    call(f"{bin_folder}/initdb", "-D", cluster, "-U", "shadowbench", "-A", "trust", "-E", "UTF8", "--locale=C.UTF-8")
    chosen = _SETTINGS if durable else _SETTINGS | _FORGETFUL
    settings = " ".join(f"-c {name}={value}" for name, value in chosen.items())
    options = f"-k {folder} {settings}"
    call(f"{bin_folder}/pg_ctl", "-D", cluster, "-w", "-l", str(folder / "log"), "-o", options, "start")
    try:
        yield f"postgresql://shadowbench@/{{}}?host={folder}"
    finally:
        call(f"{bin_folder}/pg_ctl", "-D", cluster, "-w", "-m", "immediate", "stop")
        shutil.rmtree(folder)
