"""Alembic's entry point: runs the revisions on the connection, and in the transaction, that the caller has open."""

from __future__ import annotations

from alembic import context

from shadowbench.store import access_models  # noqa: F401 - registers its tables
from shadowbench.store.models import Base

context.configure(
    connection=context.config.attributes["connection"], target_metadata=Base.metadata, render_as_batch=True
)
with context.begin_transaction():
    context.run_migrations()
