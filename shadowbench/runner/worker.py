"""A worker process: reads a call, does it, answers, until nobody asks any more.

Started by :class:`shadowbench.runner.pool.Worker` with the descriptors of its two pipes. It runs plugins' code, so it
may crash, hang or grow; the runner copes. It never outlives the runner: the kernel kills it with its parent where
it can (Linux), and elsewhere a thread that waits on the pipe notices.
"""

from __future__ import annotations

import ctypes
import faulthandler
import gc
import os
import queue
import resource
import signal
import sys
import threading
import traceback
from pathlib import Path
from typing import Any

from shadowbench.errors import InvalidResultError
from shadowbench.runner.protocol import decode, encode, outcome_of, reason_of, write_all

_MEMORY_MARGIN = 2
"""Private memory a worker may map, in units of its limit for resident memory: the limit that is watched comes first."""


class Desk:
    """What a worker can be asked, by name; each argument is a JSON value."""

    def __init__(self, answers: int) -> None:
        self._answers = answers
        self._host: Any = None
        self._registry: Any = None
        self._plugin_files: tuple[Path, ...] = ()
        self._is_frozen = False

    def start(self, plugin_files: list[str], memory_limit: int) -> None:
        """Limit memory and get ready."""
        _limit_memory(memory_limit * _MEMORY_MARGIN)
        self._plugin_files = tuple(Path(f) for f in plugin_files)
        import warp as wp

        import shadowbench.runner.case_host  # noqa: F401 - starting takes long; loading a case shall not

        wp.config.log_level = wp.LOG_WARNING

    def describe_device(self, device: str) -> dict[str, Any]:
        """See :func:`shadowbench.runner.resolving.describe_device`."""
        from shadowbench.runner import resolving

        return resolving.describe_device(device)

    def names(self, kind: str) -> list[str]:
        """Return the names of all plugins of a kind."""
        return list(self.registry.names(kind))

    def describe_method(self, name: str) -> dict[str, Any]:
        """See :func:`shadowbench.runner.resolving.describe_method`."""
        from shadowbench.runner import resolving

        return resolving.describe_method(self.registry, name)

    def resolve_method(self, name: str, values: dict[str, Any]) -> dict[str, Any]:
        """See :func:`shadowbench.runner.resolving.resolve_parameters`."""
        from shadowbench.runner import resolving

        return resolving.resolve_parameters(self.registry.method(name), f"method '{name}'", values)

    def resolve_scene(self, name: str, values: dict[str, Any]) -> dict[str, Any]:
        """See :func:`shadowbench.runner.resolving.resolve_scene`."""
        from shadowbench.runner import resolving

        return resolving.resolve_scene(self.registry, name, values)

    def place_scene(self, cache: str, scene: dict[str, Any]) -> dict[str, Any]:
        """See :func:`shadowbench.runner.preparation.place_scene`."""
        from shadowbench.runner import preparation

        return preparation.place_scene(self.registry, Path(cache), scene)

    def compile_kernels(self, methods: list[str], device: str) -> dict[str, float]:
        """Compile the kernels of methods and of what prepares their views; see :mod:`shadowbench.runner.kernels`."""
        import shadowbench.filtered_reference  # noqa: F401 - its kernels must be there to be found
        from shadowbench.runner.kernels import load_kernels

        plugins = [self.registry.method(name).__module__ for name in methods]
        return load_kernels(["shadowbench.camera_pass", "shadowbench.filtered_reference", *plugins], device)

    def prepare(self, cache: str, view: dict[str, Any], threads: int, with_reference: bool) -> dict[str, Any]:
        """See :func:`shadowbench.runner.preparation.prepare`."""
        from shadowbench.runner import preparation

        return preparation.prepare(Path(cache), view, threads, with_reference=with_reference)

    def prepare_filtered(
        self, cache: str, entries: dict[str, str], light: str, kernel: dict[str, Any], threads: int
    ) -> str:
        """See :func:`shadowbench.runner.preparation.prepare_filtered`."""
        from shadowbench.runner import preparation

        return preparation.prepare_filtered(Path(cache), entries, light, kernel, threads)

    def load_case(self, **case: Any) -> dict[str, Any]:
        """Become the host of a case: :meth:`shadowbench.runner.case_host.CaseHost.load`."""
        from shadowbench.runner.case_host import CaseHost

        self.close()
        registry = self.registry
        self._freeze()
        self._host = CaseHost(registry, self.tell_phase)
        return self._host.load(**case)

    def load_camera(self, **view: Any) -> dict[str, Any]:
        """Become the host of the camera pass."""
        from shadowbench.runner.camera_host import CameraHost

        self.close()
        self._host = CameraHost()
        return self._host.load(**view)

    def warm_up(self, repeats: Any = None) -> dict[str, Any]:
        """See the host."""
        return self._host.warm_up(repeats)

    def round(self) -> dict[str, Any]:
        """See the host."""
        return self._host.round()

    def peak_bytes(self) -> int:
        """See the host."""
        return self._host.peak_bytes()

    def kernel(self) -> dict[str, Any] | None:
        """See the host."""
        return self._host.kernel()

    def summary(self) -> dict[str, Any]:
        """See the host."""
        return self._host.summary()

    def measure(self, pictures: str, reference: str, filtered: str | None) -> dict[str, Any]:
        """See the host."""
        return self._host.measure(Path(pictures), reference, filtered)

    def close(self) -> None:
        """Let go of the case."""
        host, self._host = self._host, None
        if host is None:
            return
        host.close()
        del host
        gc.collect()

    def _freeze(self) -> None:
        """Spare the garbage collector what lives as long as the worker: most of what a case costs would be its."""
        if not self._is_frozen:
            gc.collect()
            gc.freeze()
            self._is_frozen = True

    @property
    def registry(self) -> Any:
        """The plugins; found at first use, so that a plugin file that cannot be loaded fails a call, not the start."""
        if self._registry is None:
            from shadowbench.plugins import Registry

            self._registry = Registry(self._plugin_files)
        return self._registry

    def tell_phase(self, phase: str) -> None:
        """Say what comes next, for the message if it never ends."""
        write_all(self._answers, encode({"phase": phase}))


def serve(asks: int, answers: int) -> None:
    """Answer until the other side closes."""
    desk = Desk(answers)
    calls: queue.SimpleQueue[bytes] = queue.SimpleQueue()
    threading.Thread(target=_read_calls, args=(asks, calls), daemon=True).start()
    while True:
        message = decode(calls.get())
        try:
            result = getattr(desk, message["call"])(**message["arguments"])
            answer = encode({"result": result})
        except BaseException as error:  # noqa: BLE001 - a plugin may raise anything, SystemExit too
            if not isinstance(error, InvalidResultError):
                traceback.print_exc()
            sys.stdout.flush()
            failure = {"outcome": outcome_of(error), "reason": reason_of(error), "class": type(error).__name__}
            answer = encode({"failure": failure})
        write_all(answers, answer)


def _read_calls(asks: int, calls: queue.SimpleQueue[bytes]) -> None:
    with os.fdopen(asks, "rb") as stream:
        for line in stream:
            calls.put(line)
    os._exit(0)  # the runner is gone, or wants no more; the main thread may be in an endless loop


def _die_with_parent() -> None:
    if sys.platform == "linux":
        parent = os.getppid()
        ctypes.CDLL(None).prctl(1, signal.SIGKILL)  # PR_SET_PDEATHSIG
        if os.getppid() != parent:  # it died before the kernel was told
            os._exit(0)


def _limit_memory(byte_limit: int) -> None:
    """Have the kernel refuse what a plugin asks for far beyond its limit, before it is touched."""
    if sys.platform == "linux":
        _, hard = resource.getrlimit(resource.RLIMIT_DATA)
        if hard == resource.RLIM_INFINITY or byte_limit < hard:
            resource.setrlimit(resource.RLIMIT_DATA, (byte_limit, hard))


def main() -> None:
    """Serve on the descriptors named on the command line."""
    _die_with_parent()
    faulthandler.enable()  # a crash, or SIGABRT at a timeout, prints where it was
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    asks, answers = int(sys.argv[1]), int(sys.argv[2])
    os.set_inheritable(asks, False)  # a plugin's own child processes must not hold the pipes open
    os.set_inheritable(answers, False)
    serve(asks, answers)


if __name__ == "__main__":
    main()
