"""Pictures and masks beside the database, each file named by the SHA-256 of its content.

Equal content is kept once. A file appears whole or not at all, is on the disk before its name is given out, and is
checked against its name whenever it is read.
"""

from __future__ import annotations

import hashlib
import os
import re
import secrets
from pathlib import Path

from shadowbench.errors import StoreError
from shadowbench.store.engine import store_errors

ARTIFACT_NAME = re.compile(r"[0-9a-f]{64}\.[a-z0-9]{1,8}")
"""The name of an artifact, ``<sha256>.<suffix>``."""

_SUFFIX = re.compile(r"[a-z0-9]{1,8}")


class ArtifactFolder:
    """A content-addressed folder: ``<aa>/<sha256>.<suffix>``, ``aa`` being the first two digits."""

    def __init__(self, folder: Path) -> None:
        """Use ``folder``, which is made when the first file is put into it."""
        self.folder = folder

    def put(self, content: bytes, suffix: str) -> str:
        """Keep ``content`` and return its name, ``<sha256>.<suffix>``; it is durable when this returns.

        Raises:
            StoreError: The suffix is not 1 to 8 lower-case letters and digits, or the file cannot be written.
        """
        suffix = suffix.removeprefix(".")
        if not _SUFFIX.fullmatch(suffix):
            raise StoreError(f"artifact suffix {suffix!a:.40} is not 1 to 8 lower-case letters and digits")
        name = f"{hashlib.sha256(content).hexdigest()}.{suffix}"
        path = self.path(name)
        with store_errors(path, "write the artifact"):
            if not (path.is_file() and path.read_bytes() == content):  # a damaged file is replaced
                write_whole(path, content)
        return name

    def get(self, name: str) -> bytes:
        """Return the content of an artifact.

        Raises:
            StoreError: This is no artifact's name, there is no such file, or its content is not what its name says.
        """
        path = self.path(name)
        with store_errors(path, "read the artifact"):
            content = path.read_bytes()
        if hashlib.sha256(content).hexdigest() != path.stem:
            raise StoreError(f"{path}: the artifact is damaged: its content does not have the SHA-256 that names it")
        return content

    def path(self, name: str) -> Path:
        """Return where an artifact lies, or would lie.

        Raises:
            StoreError: This is no artifact's name; above all, names cannot lead out of the folder.
        """
        if not ARTIFACT_NAME.fullmatch(name):
            raise StoreError(f"{name!a:.80} is not an artifact's name: 64 hexadecimal digits, a dot and a suffix")
        return self.folder / name[:2] / name


def write_whole(path: Path, content: bytes) -> None:
    """Write a file, wholly or not at all, and durably; its folder is made if need be."""
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_name(f".{path.name}.{secrets.token_hex(4)}")
    try:
        with partial.open("xb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        partial.replace(path)
    except BaseException:
        partial.unlink(missing_ok=True)
        raise
    folder = os.open(path.parent, os.O_RDONLY)
    try:
        os.fsync(folder)  # the name itself
    finally:
        os.close(folder)
