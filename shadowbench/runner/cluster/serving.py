"""The dask worker's side of a job: start the measuring process, pass on what it says, end it when nobody wants it.

Jobs run in the dask worker's one task thread, which waits on a pipe; its event loop stays free to answer the
scheduler. The measuring process is kept for the next job while it is the same code, and ended when it has been idle.
"""

from __future__ import annotations

import asyncio
import os
import signal
import socket
import subprocess
import sys
import threading
from contextlib import suppress
from multiprocessing.connection import Connection
from pathlib import Path
from typing import TYPE_CHECKING, Any

from distributed import Queue, get_client, get_worker
from distributed.diagnostics.plugin import WorkerPlugin

from shadowbench.identity import available_cores, machine
from shadowbench.runner.cluster.fingerprint import fingerprint
from shadowbench.runner.cluster.jobs import PLUGIN_NAME, Ending

if TYPE_CHECKING:
    from distributed import Worker

IDLE_S = 30.0
"""How long a measuring process, with the case workers parked in it, is kept for another job."""

_POLL_S = 0.2


async def greet(methods: list[str], scenes: list[str]) -> dict[str, Any]:
    """Say what this machine is and has; runs in the dask worker."""
    found = await asyncio.to_thread(fingerprint, methods, scenes)
    return {"fingerprint": found, "machine": machine(), "host": socket.gethostname(), "cores": available_cores()}


def measure(content: bytes, code: str, queue_name: str) -> dict[str, str]:
    """Have a job measured; runs in the dask worker's task thread.

    Args:
        content: Of :func:`shadowbench.runner.cluster.jobs.packed`.
        code: Digest of the code that it is to be measured with.
        queue_name: The dask queue for messages.

    Returns:
        How it ended: :meth:`shadowbench.runner.cluster.jobs.Ending.to_wire`.
    """
    worker: Any = get_worker()
    bench: BenchKeeper = worker.plugins[PLUGIN_NAME]
    return bench.do(content, code, Queue(queue_name, client=get_client())).to_wire()


class BenchKeeper(WorkerPlugin):
    """Keeps the measuring process of a dask worker.

    Args:
        folder: For its cache and for plugin files.
    """

    name = PLUGIN_NAME

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._process: BenchProcess | None = None
        self._code = ""
        self._task: Any = None
        self._unwanted: set[Any] = set()
        self._guard = threading.Lock()
        self._idle: asyncio.TimerHandle | None = None

    def setup(self, worker: Worker) -> None:
        """See :class:`WorkerPlugin`."""
        self._worker: Any = worker

    def teardown(self, worker: Worker) -> None:
        """See :class:`WorkerPlugin`."""
        self._end_process()

    def transition(self, key: Any, start: str, finish: str, **details: Any) -> None:
        """End the measuring when its task is no longer wanted: cancelled, or its client or scheduler went away."""
        if start == "executing" and finish in ("released", "cancelled"):
            self._unwanted.add(key)
            if key == self._task:
                self._end_process()

    def do(self, content: bytes, code: str, messages: Queue) -> Ending:
        """Have a job done by the measuring process."""
        self._worker.loop.add_callback(self._stop_idling)
        with self._guard:
            self._task = self._worker.get_current_task()
            process = self._process_for(code)
        try:
            if self._task in self._unwanted:  # before its process was there to be ended
                process.kill()
            process.send(content)
            while (message := process.receive())["kind"] != "end":
                self._pass_on(message, messages, process)
            return Ending.from_wire(message)
        except (EOFError, OSError):
            process.kill()
            return Ending("died", f"the measuring process {process.ending()}")
        finally:
            self._unwanted.discard(self._task)
            self._task = None
            self._worker.loop.add_callback(self._start_idling)

    def _process_for(self, code: str) -> BenchProcess:
        process = self._process
        if process is not None and process.is_alive and code == self._code:
            return process
        if process is not None:
            process.kill()
        self._process, self._code = BenchProcess(self._folder), code
        return self._process

    def _pass_on(self, message: dict[str, Any], messages: Queue, process: BenchProcess) -> None:
        """Hand a message to the client; while it has too many to read, the measuring waits."""
        while True:
            try:
                messages.put(message, timeout=5.0)
            except TimeoutError:
                if not process.is_alive:  # nobody reads any more
                    return
            else:
                return

    def _stop_idling(self) -> None:
        if self._idle is not None:
            self._idle.cancel()
            self._idle = None

    def _start_idling(self) -> None:
        self._stop_idling()
        self._idle = asyncio.get_running_loop().call_later(IDLE_S, self._end_idle)

    def _end_idle(self) -> None:
        if self._task is None:
            self._end_process()

    def _end_process(self) -> None:
        with self._guard:
            if self._process is not None:
                self._process.kill()


class BenchProcess:
    """The measuring process, seen from the dask worker."""

    def __init__(self, folder: Path) -> None:
        asks_read, asks_write = os.pipe()
        answers_read, answers_write = os.pipe()
        self._process = subprocess.Popen(
            [
                *(sys.executable, "-P", "-m", "shadowbench.runner.cluster.bench_process"),
                *(str(asks_read), str(answers_write), str(folder)),
            ],
            stdin=subprocess.DEVNULL,
            pass_fds=(asks_read, answers_write),
            start_new_session=True,
        )
        os.close(asks_read)
        os.close(answers_write)
        self._asks, self._answers = Connection(asks_write), Connection(answers_read)

    @property
    def is_alive(self) -> bool:
        """Whether it can still answer."""
        return self._process.poll() is None

    def send(self, content: bytes) -> None:
        """Give it a job.

        Raises:
            OSError: It is dead.
        """
        self._asks.send_bytes(content)

    def receive(self) -> dict[str, Any]:
        """Return its next message.

        Raises:
            EOFError: It is dead and said no more.
        """
        message: dict[str, Any] = self._answers.recv()
        return message

    def kill(self) -> None:
        """End it; its case workers end with it."""
        with suppress(ProcessLookupError, PermissionError):
            os.killpg(self._process.pid, signal.SIGKILL)
        self._process.wait()

    def ending(self) -> str:
        """Return how it ended, as the end of a sentence."""
        code = self._process.returncode
        if code is not None and code < 0:
            return f"was ended by {signal.Signals(-code).name}"
        return f"left with exit status {code}"
