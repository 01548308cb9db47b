"""Whole runs into the store: all of a run or nothing of it, and again as often as one likes.

Used by ``import`` and by the service. A run comes with a digest of its documents. The same run with the same digest
changes nothing; with another digest it takes the earlier one's place, if the same token uploaded that.
"""

from __future__ import annotations

import datetime as dt
import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

from sqlalchemy import delete, insert, select
from sqlalchemy.orm import Session

from shadowbench.errors import StoreError
from shadowbench.rows import ResultRow, RunRecord
from shadowbench.store.access_models import StoredAudit, StoredUpload
from shadowbench.store.documents import artifact_names, row_document, run_document
from shadowbench.store.inserting import insert_rows
from shadowbench.store.models import StoredRow, StoredRun
from shadowbench.store.records import row_values, run_values
from shadowbench.store.results import Store
from shadowbench.store.standings import delete_rows

IMPORTED = "import"
"""Stands where a token would for runs that came from a file."""


class Kept(StrEnum):
    """What became of a run that was put into the store."""

    CREATED = "created"
    REPLACED = "replaced"
    UNCHANGED = "unchanged"


@dataclass(frozen=True)
class KeptRun:
    """A run that was put into the store."""

    kept: Kept
    row_count: int
    digest: str
    """The SHA-256 of its documents."""


class ConflictError(StoreError):
    """The run is there already and is somebody else's, or was measured here."""


class MissingArtifactsError(StoreError):
    """Pictures or masks that the rows name are not in the store.

    Attributes:
        names: Their names.
    """

    def __init__(self, names: Sequence[str]) -> None:
        super().__init__(f"{len(names)} pictures or masks are not in the store, {names[0]} first")
        self.names = list(names)

    def __reduce__(self) -> tuple[Any, ...]:
        """Say how it is made again in another process."""
        return type(self), (self.names,)


@dataclass(frozen=True)
class Uploader:
    """Who puts a run into the store: a token's id, and the address that it came from."""

    token_id: str
    address: str = ""
    may_replace: bool = False
    """Whether runs may be replaced that another token uploaded, or that were measured here."""


def digest_of(run: RunRecord, rows: Sequence[ResultRow]) -> str:
    """Return the SHA-256 of a run's documents, the same on every machine."""
    found = hashlib.sha256(_line(run_document(run)))
    for row in rows:
        found.update(_line(row_document(row)))
    return found.hexdigest()


def put_run(store: Store, run: RunRecord, rows: Sequence[ResultRow], uploader: Uploader) -> KeptRun:
    """Keep a run and all its rows in one transaction; on the disk before this returns.

    Raises:
        MissingArtifactsError: Not all pictures and masks are there.
        ConflictError: The run is another's, see above.
        StoreError: It cannot be written.
    """
    missing = missing_artifacts(store, artifact_names(rows))
    if missing:
        raise MissingArtifactsError(missing)
    digest = digest_of(run, rows)
    # made beforehand: the time in which nobody else can write is short
    own, others = run_values(run), [row_values(row) for row in rows]
    with store.session("keep the run", writes=True) as session:
        kept = _make_room(session, run.run_id, digest, uploader)
        if kept is Kept.UNCHANGED:
            return KeptRun(kept, len(rows), digest)
        session.execute(insert(StoredRun).values(own))
        insert_rows(session, rows, others)
        upload = {"run_id": run.run_id, "digest": digest, "token_id": uploader.token_id, "uploaded_at": now()}
        session.execute(insert(StoredUpload).values(upload))
        add_to_audit(session, f"run {kept.value}", run.run_id, uploader, f"{len(rows)} rows, sha256 {digest}")
    return KeptRun(kept, len(rows), digest)


def put_picture(store: Store, content: bytes, uploader: Uploader) -> bool:
    """Keep a PNG file; on the disk, and in the audit trail, before this returns.

    File and line are not one transaction: a request that fails or is killed between them leaves a file without a line.
    So a file that is there already gets its line now if it has none; one that was measured here is found, too.

    Returns:
        Whether it is new.

    Raises:
        StoreError: It cannot be written. Sent again, it will be kept and have its line.
    """
    name = f"{hashlib.sha256(content).hexdigest()}.png"
    is_new = not store.artifacts.path(name).is_file()
    store.put_artifact(content, "png")
    if is_new or not _is_in_audit(store, name):
        with store.session("note the upload", writes=True) as session:
            action = "picture created" if is_new else "picture found"
            add_to_audit(session, action, name, uploader, f"{len(content)} bytes")
    return is_new


def _is_in_audit(store: Store, subject: str) -> bool:
    table = StoredAudit.__table__
    with store.session("look into the audit trail") as session:
        return session.execute(select(table.c.id).where(table.c.subject == subject).limit(1)).first() is not None


def missing_artifacts(store: Store, names: Sequence[str]) -> list[str]:
    """Return those of the names that the store has no file for."""
    return [name for name in names if not store.artifacts.path(name).is_file()]


def add_to_audit(session: Session, action: str, subject: str, uploader: Uploader, detail: str = "") -> None:
    """Add a line to the audit trail, in the transaction of what it tells of."""
    line = {"at": now(), "action": action, "subject": subject, "token_id": uploader.token_id}
    session.execute(insert(StoredAudit).values(line | {"address": uploader.address, "detail": detail}))


def now() -> str:
    """Return the time, ISO 8601, UTC."""
    return dt.datetime.now(dt.UTC).isoformat(timespec="seconds")


def _make_room(session: Session, run_id: str, digest: str, uploader: Uploader) -> Kept:
    table = StoredRun.__table__
    if session.execute(select(table.c.id).where(table.c.run_id == run_id)).scalar() is None:
        return Kept.CREATED
    earlier = session.get(StoredUpload, run_id)
    if earlier is not None and earlier.digest == digest:
        return Kept.UNCHANGED
    if not uploader.may_replace and (earlier is None or earlier.token_id != uploader.token_id):
        whose = "was measured here" if earlier is None else "was uploaded with another token"
        raise ConflictError(f"run '{run_id}' is there already with other content, and {whose}")
    delete_rows(session, StoredRow.__table__.c.run_id == run_id)
    session.execute(delete(StoredRun).where(table.c.run_id == run_id))
    session.expunge_all()
    return Kept.REPLACED


def _line(document: object) -> bytes:
    return json.dumps(document, sort_keys=True, separators=(",", ":"), allow_nan=False).encode("ascii") + b"\n"
