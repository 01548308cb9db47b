"""The tables of a store that others upload to: tokens, uploads and the audit trail."""

from __future__ import annotations

from sqlalchemy import BigInteger, ForeignKey, Integer, Text
from sqlalchemy.orm import Mapped, mapped_column

from shadowbench.store.models import Base


class StoredToken(Base):
    """A token. Its secret is not here: only the secret's SHA-256."""

    __tablename__ = "tokens"
    token_id: Mapped[str] = mapped_column(primary_key=True)
    name: Mapped[str]
    scope: Mapped[str]
    digest: Mapped[str]
    created_at: Mapped[str]
    expires_at: Mapped[str | None] = mapped_column(Text())
    revoked_at: Mapped[str | None] = mapped_column(Text())
    last_used_at: Mapped[str | None] = mapped_column(Text())


class StoredUpload(Base):
    """Who uploaded a run, and the digest of what was uploaded; runs that were measured here have none."""

    __tablename__ = "uploads"
    run_id: Mapped[str] = mapped_column(ForeignKey("runs.run_id", ondelete="CASCADE"), primary_key=True)
    digest: Mapped[str]
    token_id: Mapped[str]
    uploaded_at: Mapped[str]


class StoredAudit(Base):
    """One line of the audit trail. Nothing changes or deletes one."""

    __tablename__ = "audit"
    id: Mapped[int] = mapped_column(BigInteger().with_variant(Integer(), "sqlite"), primary_key=True)
    at: Mapped[str]
    action: Mapped[str]
    subject: Mapped[str]
    token_id: Mapped[str]
    address: Mapped[str]
    detail: Mapped[str]
