"""A folder of NumPy-heavy objects by key, written once and opened as read-only memory maps.

An entry holds one dataclass (a world, receivers, a reference). Its arrays lie uncompressed and aligned behind the
pickled rest, so that opening a 100 MB entry costs a page table and all workers share one copy in memory. An entry
appears under its name only when it is whole. Entries are machine-local and can be deleted at any time.
"""

from __future__ import annotations

import io
import mmap
import os
import pickle
import struct
import tempfile
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

_MAGIC = b"shadowbench cache 1\n"
_ALIGNMENT = 64
"""A cache line, and more than any NumPy or Warp type asks for."""

_WRITING = ".writing-"
_ABANDONED_S = 3600.0

_NUMPY_NAMES = frozenset({"ndarray", "dtype", "scalar", "_frombuffer", "_reconstruct"})
_MODEL_MODULES = frozenset(
    f"shadowbench.{name}"
    for name in ("scene", "placed_instances", "world", "receivers", "reference", "filtered_reference")
)


class CacheMissError(LookupError):
    """No entry has this name, or what is there cannot be read."""


class Cache:
    """A cache folder.

    Args:
        folder: Made when the first entry is stored.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def has(self, name: str) -> bool:
        """Return whether an entry is there and whole."""
        try:
            self.open(name)
        except CacheMissError:
            return False
        return True

    def store(self, name: str, value: Any) -> None:
        """Keep a value under a name; what is there already is replaced as a whole."""
        arrays: list[pickle.PickleBuffer] = []
        head = pickle.dumps(value, protocol=5, buffer_callback=arrays.append)
        raw = [array.raw() for array in arrays]
        self.folder.mkdir(parents=True, exist_ok=True)
        descriptor, temporary = tempfile.mkstemp(prefix=_WRITING, dir=self.folder)
        try:
            with os.fdopen(descriptor, "wb") as stream:
                sizes = [len(head), *(part.nbytes for part in raw)]
                stream.write(_MAGIC + struct.pack(f"<{len(sizes) + 1}Q", len(sizes), *sizes))
                parts: list[bytes | memoryview] = [head, *raw]
                for part in parts:
                    stream.write(b"\0" * (-stream.tell() % _ALIGNMENT))
                    stream.write(part)
            Path(temporary).replace(self._file(name))
        except BaseException:
            Path(temporary).unlink(missing_ok=True)
            raise

    def open(self, name: str) -> Any:
        """Return the value under a name; its arrays are read-only memory maps.

        Raises:
            CacheMissError: There is none, or it cannot be read.
        """
        file = self._file(name)
        try:
            with file.open("rb") as stream:
                content = memoryview(mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ))
            os.utime(file)  # the least recently used go first
            head, *arrays = _parts(content)
            return _Unpickler(io.BytesIO(head), buffers=arrays).load()
        except (OSError, ValueError, struct.error, pickle.UnpicklingError, EOFError, AttributeError) as error:
            raise CacheMissError(f"cache entry {name}: {error}") from error

    def prune(self, byte_limit: int) -> None:
        """Delete the least recently used entries until the folder holds at most ``byte_limit``.

        What a killed process left half written goes as well, once it is old enough to be nobody's.
        """
        for file in self.folder.glob(f"{_WRITING}*"):
            with suppress(FileNotFoundError):
                if time.time() - file.stat().st_mtime > _ABANDONED_S:
                    file.unlink()
        entries = []
        for file in self.folder.glob("*.cache"):
            try:
                status = file.stat()
            except FileNotFoundError:
                continue
            entries.append((status.st_mtime_ns, status.st_size, file))
        total = sum(size for _, size, _ in entries)
        for _, size, file in sorted(entries, key=lambda entry: entry[0]):
            if total <= byte_limit:
                return
            file.unlink(missing_ok=True)
            total -= size

    def _file(self, name: str) -> Path:
        return self.folder / f"{name}.cache"


def _parts(content: memoryview) -> list[memoryview]:
    if content[: len(_MAGIC)] != _MAGIC:
        raise ValueError("not an entry of this version")
    at = len(_MAGIC)
    (count,) = struct.unpack_from("<Q", content, at)
    sizes = struct.unpack_from(f"<{count}Q", content, at + 8)
    at += 8 * (count + 1)
    parts = []
    for size in sizes:
        at += -at % _ALIGNMENT
        if at + size > len(content):
            raise ValueError("cut short")
        parts.append(content[at : at + size])
        at += size
    return parts


class _Unpickler(pickle.Unpickler):
    """Makes the model's dataclasses and NumPy arrays, and runs nothing else that a file may name."""

    def find_class(self, module: str, name: str) -> Any:
        is_array = module.partition(".")[0] == "numpy" and name in _NUMPY_NAMES
        if is_array or module in _MODEL_MODULES:
            return super().find_class(module, name)
        raise pickle.UnpicklingError(f"an entry does not hold {module}.{name}")
