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
    cuts: Sequence[int] | None = None,
) -> None:
    """Run a kernel over the elements ``0 … count - 1``, on all threads of the context.

    Returns when the CPU is done; CUDA launches are asynchronous (see :func:`synchronize`). Results never depend on how
    the domain is cut. Starting threads and handing out a block take some tens of microseconds: blocks should be longer.

    Args:
        kernel: A kernel whose first argument is ``first: int``, to be added to ``wp.tid()``.
        count: Number of elements; 0 launches nothing.
        inputs: The kernel's arguments after ``first`` that it reads.
        outputs: The kernel's arguments that it writes. Different elements write to different places.
        context: Device and number of threads.
        block_size: Number of elements launched at a time; by default an equal share of the domain that gives every
            thread several blocks.
        cuts: First elements of all blocks but the first, increasing, where elements are unequal work.

    Raises:
        ValueError: If ``block_size`` is not positive.
        Exception: Whatever a block raises. Blocks not yet begun are then left out.
    """
    if block_size is not None and block_size < 1:
        raise ValueError(f"a block holds at least 1 element, not {block_size}")

    def launch_block(first: int, size: int, *, record_cmd: bool = False) -> Any:
        return wp.launch(
            kernel,
            dim=size,
            inputs=[first, *inputs],
            outputs=outputs,
            device=context.device,
            record_tape=False,
            record_cmd=record_cmd,
        )

    if context.threads == 1 or count <= 1 or wp.get_device(context.device).is_cuda:
        launch_block(0, count)
        return
    if cuts is None:
        cuts = range(0, count, block_size or -(-count // (_BLOCKS_PER_THREAD * context.threads)))[1:]
    if not cuts:
        launch_block(0, count)
        return

    blocks = _Blocks(count, cuts)

    def launch_remaining_blocks(command: wp.Launch | None = None) -> None:
        try:
            command = command or launch_block(0, 1, record_cmd=True)  # to replay, in a quarter of a launch's time
            for first, end in blocks:
                command.set_param_at_index(0, first)
                command.set_dim(end - first)
                command.launch()
        except BaseException:
            blocks.stop()
            raise

    # Loading a module is not for threads side by side: here, by recording a launch, before any of them starts.
    command = launch_block(0, 1, record_cmd=True)
    helper_count = min(context.threads - 1, len(cuts))
    helpers = [_thread_pool(context.threads - 1).submit(launch_remaining_blocks) for _ in range(helper_count)]
    try:
        launch_remaining_blocks(command)
    finally:
        begun = [helper for helper in helpers if not helper.cancel()]
        wait(begun)  # no block outlives this call
    for helper in begun:
        helper.result()


def synchronize(context: Context) -> None:
    """Wait until everything launched on the context's device has finished."""
    wp.synchronize_device(context.device)


class _Blocks:
    """The blocks [first, end) of a domain, each handed to whichever thread asks next."""

    def __init__(self, count: int, cuts: Sequence[int]) -> None:
        self._blocks = iter(zip([0, *cuts], [*cuts, count], strict=True))
        self._lock = Lock()

    def __iter__(self) -> Iterator[tuple[int, int]]:
        while True:
            with self._lock:
                block = next(self._blocks, None)
            if block is None:
                return
            yield block

    def stop(self) -> None:
        """Hand out no more blocks."""
        with self._lock:
            for _ in self._blocks:
                pass


@cache
def _thread_pool(threads: int) -> ThreadPoolExecutor:
    return ThreadPoolExecutor(max_workers=threads, thread_name_prefix="shadowbench-launch")


if hasattr(os, "register_at_fork"):  # threads do not survive a fork
    os.register_at_fork(after_in_child=_thread_pool.cache_clear)
