"""Launches cover the domain once, however it is cut, and never hide an error."""

import threading
from typing import Any

import numpy as np
import pytest
import warp as wp

from shadowbench.device.launch import Context, kernel_options, launch, synchronize

wp.set_module_options(kernel_options(native=True))


@wp.kernel
def count_visit(first: wp.int32, amount: wp.int32, visits: wp.array[wp.int32]):
    i = wp.tid() + first
    visits[i] = visits[i] + amount


@wp.kernel
def copy_any(first: wp.int32, source: wp.array[Any], target: wp.array[Any]):
    i = wp.tid() + first
    target[i] = source[i]


@wp.func_native("return a * b + c;")
def multiply_add(a: wp.float32, b: wp.float32, c: wp.float32) -> wp.float32: ...


@wp.kernel
def multiply_add_all(first: wp.int32, a: wp.array[wp.float32], b: wp.array[wp.float32], c: wp.array[wp.float32]):
    i = wp.tid() + first
    c[i] = multiply_add(a[i], b[i], c[i])


@pytest.mark.parametrize("threads", [1, 2, 3, 5])
@pytest.mark.parametrize("block_size", [None, 1, 7, 64, 1000])
@pytest.mark.parametrize("count", [1, 6, 64, 129])
def test_every_element_is_visited_exactly_once(count: int, block_size: int | None, threads: int) -> None:
    visits = wp.zeros(count + 8, dtype=wp.int32, device="cpu")
    context = Context(threads=threads)
    launch(count_visit, count, inputs=[3], outputs=[visits], context=context, block_size=block_size)
    synchronize(context)
    assert visits.numpy().tolist() == [3] * count + [0] * 8


@pytest.mark.parametrize("threads", [1, 2, 4])
@pytest.mark.parametrize("cuts", [[], [1], [99], [3, 4, 50], list(range(1, 100))])
def test_a_domain_cut_into_unequal_blocks_is_covered_exactly_once(cuts: list[int], threads: int) -> None:
    visits = wp.zeros(108, dtype=wp.int32, device="cpu")
    launch(count_visit, 100, inputs=[1], outputs=[visits], context=Context(threads=threads), cuts=cuts)
    assert visits.numpy().tolist() == [1] * 100 + [0] * 8


@pytest.mark.parametrize("threads", [1, 3])
def test_an_empty_domain_launches_nothing(threads: int) -> None:
    visits = wp.zeros(4, dtype=wp.int32, device="cpu")
    launch(count_visit, 0, inputs=[1], outputs=[visits], context=Context(threads=threads))
    assert not visits.numpy().any()


def test_a_generic_kernel_is_resolved_before_threads_start() -> None:
    source = wp.array(np.arange(100.0), dtype=wp.float64, device="cpu")
    target = wp.zeros(100, dtype=wp.float64, device="cpu")
    launch(copy_any, 100, inputs=[source], outputs=[target], context=Context(threads=4), block_size=1)
    assert np.array_equal(target.numpy(), source.numpy())


def test_launches_from_several_threads_at_once_do_not_mix() -> None:
    arrays = [wp.zeros(1000, dtype=wp.int32, device="cpu") for _ in range(4)]

    def run(amount: int) -> None:
        for _ in range(5):
            launch(count_visit, 1000, inputs=[amount], outputs=[arrays[amount]], context=Context(threads=2))

    callers = [threading.Thread(target=run, args=(k,)) for k in range(4)]
    for caller in callers:
        caller.start()
    for caller in callers:
        caller.join()
    for amount, array in enumerate(arrays):
        assert (array.numpy() == 5 * amount).all()


@pytest.mark.parametrize("threads", [1, 3])
def test_a_wrong_argument_raises_here(threads: int) -> None:
    with pytest.raises(RuntimeError, match="visits"):
        launch(count_visit, 100, inputs=[1], outputs=["no array"], context=Context(threads=threads))


def test_a_block_that_raises_stops_the_others_and_raises_here(monkeypatch: pytest.MonkeyPatch) -> None:
    launched: list[int] = []
    real = wp.Launch.launch

    def failing(self: wp.Launch, *args: object) -> None:
        first = self.params[1]
        launched.append(int(getattr(first, "value", first)))
        if launched[-1] == 5:
            raise OverflowError("block 5")
        real(self, *args)

    monkeypatch.setattr(wp.Launch, "launch", failing)
    visits = wp.zeros(100_000, dtype=wp.int32, device="cpu")
    with pytest.raises(OverflowError, match="block 5"):
        launch(count_visit, 100_000, inputs=[1], outputs=[visits], context=Context(threads=3), block_size=1)
    assert len(launched) < 100_000
    assert len(launched) == len(set(launched))


def test_sizes_that_make_no_sense_are_refused() -> None:
    with pytest.raises(ValueError, match="at least 1 thread, not 0"):
        Context(threads=0)
    with pytest.raises(ValueError, match="at least 1 element, not 0"):
        launch(count_visit, 4, inputs=[1], outputs=[None], context=Context(), block_size=0)


def test_native_modules_round_after_every_operation() -> None:
    random = np.random.default_rng(7)
    a, b, c = (random.uniform(-1.0, 1.0, 1000).astype(np.float32) for _ in range(3))
    result = wp.array(c, dtype=wp.float32, device="cpu")
    launch(
        multiply_add_all,
        1000,
        inputs=[wp.array(a, device="cpu"), wp.array(b, device="cpu")],
        outputs=[result],
        context=Context(),
    )
    fused = (a.astype(np.float64) * b + c).astype(np.float32)  # the product is exact in float64
    assert np.array_equal(result.numpy(), a * b + c)
    assert not np.array_equal(fused, a * b + c), "the numbers do not tell the two apart"
