"""Kernel launches on any number of threads: the one place that cuts a domain into blocks.

Warp runs a CPU launch on the calling thread and releases the interpreter lock while it does. `launch` therefore cuts
a 1-D domain into blocks and launches them from a thread pool; on CUDA it is one plain launch. Kernels launched here
take ``first: int`` as their first argument and work on element ``wp.tid() + first``; blocks must write to disjoint
places, which makes every result independent of the number of threads. Kernel modules take their Warp options from
`kernel_options`. Everything in shadowbench and its plugins may use this module; it knows nothing of shadows.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from dataclasses import dataclass
from functools import cache
from threading import Lock
from typing import Any

import warp as wp

_BLOCKS_PER_THREAD = 8
"""Blocks a thread gets on average where no block size is asked for: enough to even out unequal blocks."""


@dataclass(frozen=True)
class Context:
    """Where kernels run.

    Args:
        device: Warp device name, such as ``"cpu"`` or ``"cuda:0"``.
        threads: Number of CPU threads, at least 1. Without effect on CUDA.
    """

    device: str = "cpu"
    threads: int = 1

    def __post_init__(self) -> None:
        if self.threads < 1:
            raise ValueError(f"a context needs at least 1 thread, not {self.threads}")


def kernel_options(*, native: bool = False) -> dict[str, Any]:
    """Return the Warp module options that kernel modules of shadowbench share.

    A kernel module calls ``wp.set_module_options(kernel_options())`` before its first kernel. No gradient is generated.

    Args:
        native: For modules with `wp.func_native` bodies: forbids the compiler to fuse a multiplication and an addition
            into one rounding. Plain Warp code is never fused on the CPU, but a native body is, after which an edge
            function is no longer antisymmetric and bits differ between machines.
    """
    options: dict[str, Any] = {"enable_backward": False}
    if native:
        options["fuse_fp"] = False
        # The module option replaces Warp's own flags instead of adding to them.
        options["cpu_compiler_flags"] = f"{wp.config.cpu_compiler_flags or '-march=native'} -ffp-contract=off"
    return options


def launch(
    kernel: wp.Kernel,
    count: int,
    inputs: Sequence[Any],
    outputs: Sequence[Any],
    *,
    context: Context,
    block_size: int | None = None,
) -> None:
    """Run a kernel over the elements ``0 … count - 1``, on all threads of the context.

    Returns when the CPU is done; CUDA launches are asynchronous (see `synchronize`).

    Args:
        kernel: A kernel whose first argument is ``first: int``, to be added to ``wp.tid()``.
        count: Number of elements; 0 launches nothing.
        inputs: The kernel's arguments after ``first`` that it reads.
        outputs: The kernel's arguments that it writes. Different elements write to different places.
        context: Device and number of threads.
        block_size: Number of elements launched at a time; by default an equal share of the domain that gives every
            thread several blocks. Results never depend on it.

    Raises:
        ValueError: If ``block_size`` is not positive.
        Exception: Whatever a block raises. Blocks not yet begun are then left out.
    """
    if block_size is None:
        block_size = max(1, -(-count // (_BLOCKS_PER_THREAD * context.threads)))
    elif block_size < 1:
        raise ValueError(f"a block holds at least 1 element, not {block_size}")

    def launch_block(first: int, size: int, *, record_cmd: bool = False) -> wp.Launch | None:
        return wp.launch(
            kernel,
            dim=size,
            inputs=[first, *inputs],
            outputs=outputs,
            device=context.device,
            record_tape=False,
            record_cmd=record_cmd,
        )

    thread_count = min(context.threads, -(-count // block_size))
    if thread_count <= 1 or wp.get_device(context.device).is_cuda:
        launch_block(0, count)
        return

    firsts = _Firsts(count, block_size)

    def launch_remaining_blocks() -> None:
        try:
            command = launch_block(0, block_size, record_cmd=True)  # replayed in a quarter of the time of a launch
            for first in firsts:
                command.set_param_at_index(0, first)
                if count - first < block_size:
                    command.set_dim(count - first)
                command.launch()
        except BaseException:
            firsts.stop()
            raise

    # Loading a module is not for threads side by side: here, by recording a launch, before any of them starts.
    launch_block(0, block_size, record_cmd=True)
    futures = [_thread_pool(context.threads - 1).submit(launch_remaining_blocks) for _ in range(thread_count - 1)]
    try:
        launch_remaining_blocks()
    finally:
        wait(futures)  # no block outlives this call
    for future in futures:
        future.result()


def synchronize(context: Context) -> None:
    """Wait until everything launched on the context's device has finished."""
    wp.synchronize_device(context.device)


class _Firsts:
    """The first elements of the blocks of a domain, each handed to whichever thread asks next."""

    def __init__(self, count: int, block_size: int) -> None:
        self._firsts = iter(range(0, count, block_size))
        self._lock = Lock()

    def __iter__(self) -> Iterator[int]:
        while True:
            with self._lock:
                first = next(self._firsts, None)
            if first is None:
                return
            yield first

    def stop(self) -> None:
        """Hand out no more blocks."""
        with self._lock:
            self._firsts = iter(range(0))


@cache
def _thread_pool(threads: int) -> ThreadPoolExecutor:
    return ThreadPoolExecutor(max_workers=threads, thread_name_prefix="shadowbench-launch")


os.register_at_fork(after_in_child=_thread_pool.cache_clear)  # threads do not survive a fork
