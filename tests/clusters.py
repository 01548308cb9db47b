"""A scheduler and workers on this machine, each a process as a user starts it."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from types import TracebackType
from typing import Self

import psutil

from shadowbench.runner.cases import ClusterAccess

COMMAND = (sys.executable, "-m", "shadowbench")

BENCH = "shadowbench.runner.cluster.bench_process"
CASE = "shadowbench.runner.worker"
"""The modules that a worker's measuring process and a case's process run."""


class LocalCluster:
    """A scheduler, and workers that share a cache and a host lock of their own. Leaving it ends all of them.

    Args:
        folder: For caches and locks.
        tls: ``--tls-ca``, ``--tls-cert`` and ``--tls-key``, if they are to be used.
    """

    def __init__(self, folder: Path, tls: tuple[Path, Path, Path] | None = None) -> None:
        self._folder = folder
        self._tls = tls
        names = ("--tls-ca", "--tls-cert", "--tls-key")
        self._options = [] if tls is None else [str(part) for pair in zip(names, tls, strict=True) for part in pair]
        self._processes: list[subprocess.Popen[str]] = []
        self._environment = os.environ | {
            "SHADOWBENCH_HOST_LOCK": str(folder / "lock"),
            "OMP_NUM_THREADS": "7",  # what a case gets must not come from here
        }

    def __enter__(self) -> Self:
        protocol = "tcp" if self._tls is None else "tls"
        self.scheduler = self._start("scheduler", f"{protocol}://127.0.0.1:0", *self._options)
        self.address = self._said(self.scheduler).split()[-1]
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for process in self._processes:
            process.kill()
            process.wait()
            assert process.stderr is not None
            process.stderr.close()

    @property
    def access(self) -> ClusterAccess:
        """How to reach it."""
        return ClusterAccess(self.address, *(self._tls or ()))

    @property
    def workers(self) -> list[subprocess.Popen[str]]:
        """The workers that were started and are not dead."""
        return [process for process in self._processes[1:] if process.poll() is None]

    def worker(self, *command: str) -> subprocess.Popen[str]:
        """Start a worker and wait until the scheduler knows it."""
        arguments = (self.address, "--cache", str(self._folder / "cache"), *self._options)
        process = self._start("worker", *arguments, command=command or COMMAND)
        self._said(process)
        return process

    def end_idle_processes(self) -> None:
        """End the measuring processes that wait for another job, so that those that are seen later are of that job."""
        for worker in self.workers:
            for process in running_below(worker, BENCH):
                process.kill()  # its case processes die with it

    def _start(self, *arguments: str, command: tuple[str, ...] = COMMAND) -> subprocess.Popen[str]:
        process = subprocess.Popen(
            [*command, *arguments], stderr=subprocess.PIPE, text=True, env=self._environment, stdin=subprocess.DEVNULL
        )
        self._processes.append(process)
        return process

    @staticmethod
    def _said(process: subprocess.Popen[str]) -> str:
        """Return the first line that a process says: that it is ready."""
        assert process.stderr is not None
        line = process.stderr.readline()
        assert process.poll() is None, line
        return line


def running_below(process: subprocess.Popen[str], module: str) -> list[psutil.Process]:
    """Return the descendants of a process that run a module."""
    found = []
    for child in psutil.Process(process.pid).children(recursive=True):
        try:
            if module in child.cmdline():
                found.append(child)
        except psutil.NoSuchProcess:
            continue
    return found
