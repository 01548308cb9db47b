"""Worker processes: started, asked one thing at a time, watched while they answer, and killed without mercy.

A worker is a whole process group of its own. Nothing a plugin does can outlast its time or its memory: the runner
polls the worker's resident size and the clock, and kills the group with a signal that cannot be caught. A worker in
turn dies with the runner, whatever it is doing. Workers must be started from a thread that lives as long as they do
(on Linux the kernel kills them with it).
"""

from __future__ import annotations

import os
import selectors
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import psutil

from shadowbench.rows import Outcome
from shadowbench.runner.protocol import CaseFailure, decode, encode, write_all

START_TIMEOUT_S = 120.0
"""For the interpreter and Warp to start, on a machine that does much else."""

_POLL_S = 0.05
_GRACE_S = 1.0
"""Between the signal on which a worker prints where it hangs, and the one that ends it."""

_TAIL_BYTES = 8192
_THREAD_VARIABLES = (
    "OMP_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "NUMEXPR_NUM_THREADS",
    "VECLIB_MAXIMUM_THREADS",
    "LP_NUM_THREADS",
)


def default_memory_limit() -> int:
    """Return the resident size at which a worker is stopped unless the user says otherwise [bytes]."""
    return min(8 << 30, int(0.6 * psutil.virtual_memory().total))


class Worker:
    """One worker process, ready or still starting.

    Args:
        threads: Threads that libraries of a plugin may start.
        settings: What the worker gets first: plugin files, memory limit.
    """

    def __init__(self, threads: int, settings: dict[str, Any]) -> None:
        self.threads = threads
        self.memory_limit: int = settings["memory_limit"]
        self.phase = self._phase_of_call = "starting"
        self._tail = b""
        self._unread = b""
        ask_read, self._ask = os.pipe()
        self._answers, answer_write = os.pipe()
        self._output, output_write = os.pipe()
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-m", "shadowbench.runner.worker", str(ask_read), str(answer_write)],
            stdin=subprocess.DEVNULL,
            stdout=output_write,
            stderr=output_write,
            pass_fds=(ask_read, answer_write),
            start_new_session=True,
            env=_environment(threads),
        )
        for descriptor in (ask_read, answer_write, output_write):
            os.close(descriptor)
        for descriptor in (self._answers, self._output):
            os.set_blocking(descriptor, False)
        self._selector = selectors.DefaultSelector()
        self._selector.register(self._answers, selectors.EVENT_READ, self._read_answers)
        self._selector.register(self._output, selectors.EVENT_READ, self._read_output)
        self._watch = psutil.Process(self._process.pid)
        self.is_alive = True
        self.is_busy = False
        self._started = False
        self._send({"call": "start", "arguments": settings})

    @property
    def process_id(self) -> int:
        """The worker's own; what it starts has others."""
        return self._process.pid

    def ask(self, call: str, arguments: dict[str, Any], timeout_s: float) -> Any:
        """Have the worker do something and return its answer.

        Args:
            call: A name that :mod:`shadowbench.runner.worker` knows.
            arguments: JSON values.
            timeout_s: Time for the answer; not counted while the worker is still starting.

        Raises:
            CaseFailure: The worker raised, died, took too long or too much memory. Unless it merely raised it is dead.
        """
        self.begin(call, arguments)
        return self.end(timeout_s)

    def begin(self, call: str, arguments: dict[str, Any]) -> None:
        """Have a living worker do something; :meth:`end` waits for its answer."""
        self._phase_of_call = call.replace("_", " ")
        self.is_busy = True
        self._send({"call": call, "arguments": arguments})

    def end(self, timeout_s: float) -> Any:
        """Return the answer to what was begun.

        Raises:
            CaseFailure: As for :meth:`ask`.
        """
        try:
            if not self._started:
                self._await(START_TIMEOUT_S)
                self._started = True
            self.phase = self._phase_of_call
            return self._await(timeout_s)
        finally:
            self.is_busy = False

    def has_ended(self) -> bool:
        """Return whether the process is gone: killed by :meth:`kill`, or by somebody else."""
        return not self.is_alive or self._process.poll() is not None

    def forget_output(self) -> None:
        """Drop what was written so far: the next case is another one's."""
        self._drain_output()
        self._tail = b""

    def output_tail(self) -> str:
        """Return the end of what the worker wrote."""
        return self._tail.decode("utf-8", "replace").strip()

    def kill(self) -> None:
        """End the worker and all that it started. Does nothing to a dead one."""
        if not self.is_alive:
            return
        self.is_alive = False
        self._signal(signal.SIGKILL)
        self._process.wait()
        self._drain_output()
        self._selector.close()
        for descriptor in (self._ask, self._answers, self._output):
            os.close(descriptor)

    def _send(self, message: dict[str, Any]) -> None:
        with suppress(BrokenPipeError):  # it died; waiting for the answer will tell how
            write_all(self._ask, encode(message))

    def _await(self, timeout_s: float) -> Any:
        deadline = time.monotonic() + timeout_s
        while True:
            while (message := self._next_message()) is not None:
                if "phase" in message:
                    self.phase = message["phase"]
                elif "failure" in message:
                    self._drain_output()
                    failure = message["failure"]
                    raise CaseFailure(
                        Outcome(failure["outcome"]),
                        failure["reason"],
                        error_class=failure["class"],
                        stderr_tail=self.output_tail(),
                    )
                else:
                    return message["result"]
            if self._process.poll() is not None:
                raise self._died()
            size = self.resident_size()
            if size > self.memory_limit:
                self.kill()
                limit = f"its limit is {_gigabytes(self.memory_limit)}"
                raise CaseFailure(
                    Outcome.OUT_OF_MEMORY,
                    f"held {_gigabytes(size)} of memory during {self.phase}; {limit}",
                    stderr_tail=self.output_tail(),
                )
            if time.monotonic() > deadline:
                raise self._timed_out(timeout_s)
            for key, _ in self._selector.select(_POLL_S):
                key.data()

    def _next_message(self) -> dict[str, Any] | None:
        """Take the next whole line; what follows it, the answer to another call perhaps, stays."""
        line, separator, rest = self._unread.partition(b"\n")
        if not separator:
            return None
        self._unread = rest
        return decode(line)

    def _died(self) -> CaseFailure:
        code = self._process.returncode
        phase = self.phase
        self.kill()
        reason = f"ended by {_signal_name(-code)}" if code < 0 else f"left with exit status {code}"
        if code == -signal.SIGKILL:
            reason += " (from the system's out-of-memory killer, or by hand)"
        return CaseFailure(
            Outcome.CRASH,
            f"the worker {reason} during {phase}",
            stderr_tail=self.output_tail(),
            is_from_outside=code == -signal.SIGKILL,
        )

    def _timed_out(self, timeout_s: float) -> CaseFailure:
        # the worker's fault handler prints on SIGABRT where each thread is, even inside a loop in C
        self._signal(signal.SIGABRT)
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(_GRACE_S)
        self.kill()
        reason = f"no end of {self.phase} within {timeout_s:g} s"
        return CaseFailure(Outcome.TIMEOUT, reason, stderr_tail=self.output_tail())

    def _signal(self, number: signal.Signals) -> None:
        with suppress(ProcessLookupError, PermissionError):
            os.killpg(self._process.pid, number)

    def resident_size(self) -> int:
        """Return what the worker holds of the machine's memory, shared maps included [bytes]."""
        try:
            return int(self._watch.memory_info().rss)
        except psutil.Error:
            return 0

    def _read_answers(self) -> None:
        self._unread += self._read(self._answers)

    def _read_output(self) -> None:
        self._tail = (self._tail + self._read(self._output))[-_TAIL_BYTES:]

    def _read(self, descriptor: int) -> bytes:
        try:
            content = os.read(descriptor, 1 << 16)
        except BlockingIOError:
            return b""
        if not content:  # closed: stop asking about it
            self._selector.unregister(descriptor)
        return content

    def _drain_output(self) -> None:
        if self._output not in self._selector.get_map():
            return
        before = None
        while before != self._tail:
            before = self._tail
            self._read_output()
            if self._output not in self._selector.get_map():
                return


class Pool:
    """Workers that wait to be asked, by the number of threads they were started with.

    Use as a context manager: leaving it kills every worker.

    Args:
        plugin_files: Files given with ``--plugin``.
        memory_limit: For each worker [bytes].
    """

    def __init__(self, plugin_files: tuple[Path, ...], memory_limit: int) -> None:
        self._settings = {"plugin_files": [str(f.absolute()) for f in plugin_files], "memory_limit": memory_limit}
        self._parked: list[Worker] = []
        self._all: list[Worker] = []

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for worker in self._all:
            worker.kill()

    def take(self, threads: int) -> Worker:
        """Return a parked worker, or a new one that is still starting."""
        for worker in self._parked:
            if worker.threads == threads and not worker.has_ended():
                self._parked.remove(worker)
                worker.forget_output()
                return worker
        return self._start(threads)

    def take_fresh(self, threads: int) -> Worker:
        """Return a new worker that is still starting, whatever is parked."""
        return self._start(threads)

    def warm(self, threads: int, count: int) -> None:
        """Have at least ``count`` workers parked or starting, so that they start while others work."""
        ready = sum(worker.threads == threads and not worker.has_ended() for worker in self._parked)
        self._parked += [self._start(threads) for _ in range(count - ready)]

    def park(self, worker: Worker) -> None:
        """Take a healthy worker back."""
        self._parked.append(worker)

    def _start(self, threads: int) -> Worker:
        self._all = [worker for worker in self._all if worker.is_alive]
        worker = Worker(threads, self._settings)
        self._all.append(worker)
        return worker


def _environment(threads: int) -> dict[str, str]:
    own = dict.fromkeys(_THREAD_VARIABLES, str(threads))
    return os.environ | own | {"PYTHONHASHSEED": "0", "PYTHONUNBUFFERED": "1"}


def _signal_name(number: int) -> str:
    with suppress(ValueError):
        return signal.Signals(number).name
    return f"signal {number}"


def _gigabytes(size: int) -> str:
    return f"{size / 2**30:.2f} GiB"
