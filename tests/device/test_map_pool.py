"""Depth maps by key in one array: what is kept, what is new, and where."""

import numpy as np

from shadowbench.device.launch import Context
from shadowbench.device.map_pool import MapPool


def _filled(resolutions):
    """A pool whose maps hold a number each."""
    pool = MapPool(Context())
    pool.arrange(resolutions)
    for number, key in enumerate(resolutions, 1):
        pool.map(key).fill_(float(number))
    return pool


def test_maps_lie_side_by_side_without_gaps_or_overlap():
    pool = _filled({"a": 4, "b": 7, "c": 1})
    assert pool.depth.numpy().tolist() == [1.0] * 16 + [2.0] * 49 + [3.0]
    assert pool.map("b").shape == (7, 7)
    assert pool.first_texel == {"a": 0, "b": 16, "c": 65}


def test_the_same_maps_again_are_all_there():
    pool = _filled({"a": 4, "b": 7})
    memory = pool.depth.ptr
    assert pool.arrange({"a": 4, "b": 7}) == set()
    assert pool.depth.ptr == memory


def test_maps_that_stay_keep_what_they_hold_when_others_come_and_go():
    pool = _filled({"a": 4, "b": 7, "c": 3})
    assert pool.arrange({"new": 5, "c": 3, "a": 4}) == {"new"}
    assert pool.depth.size == 25 + 9 + 16
    assert (pool.map("c").numpy() == 3.0).all()
    assert (pool.map("a").numpy() == 1.0).all()


def test_a_map_of_another_size_is_new():
    pool = _filled({"a": 4, "b": 7})
    assert pool.arrange({"a": 8, "b": 7}) == {"a"}
    assert (pool.map("b").numpy() == 2.0).all()


def test_fewer_maps_take_less_memory():
    pool = _filled({"a": 4, "b": 7})
    assert pool.arrange({"b": 7}) == set()
    assert pool.depth.size == 49
    assert (pool.map("b").numpy() == 2.0).all()


def test_other_maps_of_the_same_sizes_use_the_same_memory():
    pool = _filled({"a": 4, "b": 7})
    memory = pool.depth.ptr
    assert pool.arrange({"c": 7, "d": 4}) == {"c", "d"}
    assert pool.depth.ptr == memory
    assert np.isin(pool.map("c").numpy(), (1.0, 2.0)).all()
