"""A service as its own process, as a user starts it."""

from __future__ import annotations

import json
import os
import socket
import subprocess
import sys
import urllib.error
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path


@dataclass
class Live:
    """A running ``shadowbench serve``."""

    process: subprocess.Popen[str]
    address: str
    log: Path


def free_port() -> int:
    with socket.socket() as listening:
        listening.bind(("127.0.0.1", 0))
        port: int = listening.getsockname()[1]
        return port


def start(results: Path, *options: str, port: int | None = None, database: str | None = None) -> Live:
    """Start a service and wait until it answers."""
    port = port or free_port()
    log = results.parent / f"serve-{port}.log"
    command = [sys.executable, "-m", "shadowbench", "serve", "--results", str(results), "--port", str(port), *options]
    command += [] if database is None else ["--database", database]
    environment = {name: value for name, value in os.environ.items() if not name.startswith("SHADOWBENCH_")}
    with log.open("a") as stream:
        process = subprocess.Popen(command, stderr=stream, stdout=stream, text=True, env=environment)
    address = f"http://127.0.0.1:{port}"
    while process.poll() is None:
        try:
            with urllib.request.urlopen(f"{address}/healthz", timeout=5) as answer:
                assert json.load(answer)["status"] == "ok"
                return Live(process, address, log)
        except (OSError, urllib.error.URLError):
            continue
    raise AssertionError(f"the service ended at once: {log.read_text()}")


@contextmanager
def serving(results: Path, *options: str, database: str | None = None) -> Iterator[Live]:
    """Run a service for the length of a block, and end it as an operator does."""
    live = start(results, *options, database=database)
    try:
        yield live
    finally:
        live.process.terminate()
        live.process.wait(timeout=60)
