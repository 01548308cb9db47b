"""Device copies of host data, made once and kept for as long as the host data lives."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar
from weakref import WeakKeyDictionary

_Host = TypeVar("_Host")
_OnDevice = TypeVar("_OnDevice")


def once_per_device(make: Callable[[_Host, str], _OnDevice]) -> Callable[[_Host, str], _OnDevice]:
    """Remember what ``make(host, device)`` returns until ``host`` is gone.

    The value may refer to the host's arrays but not to the host itself, which would then never go.
    """
    made: WeakKeyDictionary[_Host, dict[str, _OnDevice]] = WeakKeyDictionary()

    def remembered(host: _Host, device: str) -> _OnDevice:
        by_device = made.setdefault(host, {})
        if device not in by_device:
            by_device[device] = make(host, device)
        return by_device[device]

    return remembered
