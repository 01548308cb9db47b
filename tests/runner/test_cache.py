"""The cache: what goes in comes out, read-only; what is damaged or foreign does not."""

import os
import pickle
from pathlib import Path

import numpy as np
import pytest
from builders import box_over_ground, flat_receivers

from shadowbench.identity import content_digest
from shadowbench.runner.cache import Cache, CacheMissError


def test_a_world_comes_out_as_it_went_in(tmp_path: Path) -> None:
    cache, world = Cache(tmp_path), box_over_ground()
    cache.store("world-1", world)
    opened = cache.open("world-1")
    assert content_digest(opened) == content_digest(world)
    assert np.array_equal(opened.casters.vertices, world.casters.vertices)
    assert not list(tmp_path.glob(".writing*"))


def test_arrays_of_an_entry_are_read_only_aligned_and_not_copied(tmp_path: Path) -> None:
    cache = Cache(tmp_path)
    cache.store("receivers-1", flat_receivers(16, 9))
    opened = cache.open("receivers-1")
    for name in ("position", "pixel", "valid", "first_of_pixel"):
        array = getattr(opened, name)
        assert not array.flags.writeable
        assert array.ctypes.data % 64 == 0
        assert array.base is not None
    with pytest.raises(ValueError, match="read-only"):
        opened.position[0] = 1.0


def test_a_missing_a_cut_and_a_foreign_entry_are_misses(tmp_path: Path) -> None:
    cache = Cache(tmp_path)
    with pytest.raises(CacheMissError):
        cache.open("absent")
    cache.store("receivers-1", flat_receivers(4, 4))
    whole = (tmp_path / "receivers-1.cache").read_bytes()
    for content in (b"", whole[:10], whole[:40], whole[:-1], b"x" * len(whole)):
        (tmp_path / "cut.cache").write_bytes(content)
        with pytest.raises(CacheMissError):
            cache.open("cut")


class _Harm:
    def __reduce__(self) -> tuple[object, tuple[str]]:
        return os.system, ("exit 1",)


def test_an_entry_cannot_name_anything_but_the_model_and_arrays(tmp_path: Path) -> None:
    cache = Cache(tmp_path)
    cache.store("harm", _Harm())
    with pytest.raises(CacheMissError, match=r"does not hold posix\.system"):
        cache.open("harm")


def test_a_value_that_cannot_be_kept_leaves_nothing_behind(tmp_path: Path) -> None:
    with pytest.raises((pickle.PicklingError, AttributeError, TypeError)):
        Cache(tmp_path).store("bad", lambda: None)
    assert not list(tmp_path.iterdir())


def test_pruning_deletes_what_was_not_used_for_longest(tmp_path: Path) -> None:
    cache = Cache(tmp_path)
    for age, name in enumerate(("newest", "middle", "oldest")):
        cache.store(name, flat_receivers(8, 8))
        os.utime(tmp_path / f"{name}.cache", (1e9 - age, 1e9 - age))
    size = (tmp_path / "oldest.cache").stat().st_size
    cache.open("oldest")  # using it makes it the newest
    cache.prune(2 * size)
    assert sorted(file.stem for file in tmp_path.iterdir()) == ["newest", "oldest"]
    cache.prune(0)
    assert not list(tmp_path.iterdir())
