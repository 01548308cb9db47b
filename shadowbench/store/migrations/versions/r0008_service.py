"""Tokens, uploads and the audit trail, and what leaderboards and lists of runs are found by.

Revision ID: 0008
Revises: 0007
"""

from __future__ import annotations

import hashlib
import json

import sqlalchemy as sa
from alembic import op

revision: str = "0008"
down_revision: str | None = "0007"
branch_labels: str | None = None
depends_on: str | None = None

_IDENTIFIER = sa.BigInteger().with_variant(sa.Integer(), "sqlite")
_VIEW = ("scene", "scene_parameters", "light", "camera", "width", "height", "pixel_samples", "layers", "moving")
_TECHNIQUE = ("method", "method_parameters", "moving", "device", "threads")
_AT_ONCE = 500


def upgrade() -> None:
    """Make three tables and two columns of hashes, filled in for the rows that are there."""
    op.create_table(
        "tokens",
        sa.Column("token_id", sa.Text(), nullable=False),
        sa.Column("name", sa.Text(), nullable=False),
        sa.Column("scope", sa.Text(), nullable=False),
        sa.Column("digest", sa.Text(), nullable=False),
        sa.Column("created_at", sa.Text(), nullable=False),
        sa.Column("expires_at", sa.Text(), nullable=True),
        sa.Column("revoked_at", sa.Text(), nullable=True),
        sa.Column("last_used_at", sa.Text(), nullable=True),
        sa.PrimaryKeyConstraint("token_id", name="pk_tokens"),
    )
    op.create_table(
        "uploads",
        sa.Column("run_id", sa.Text(), nullable=False),
        sa.Column("digest", sa.Text(), nullable=False),
        sa.Column("token_id", sa.Text(), nullable=False),
        sa.Column("uploaded_at", sa.Text(), nullable=False),
        sa.PrimaryKeyConstraint("run_id", name="pk_uploads"),
        sa.ForeignKeyConstraint(["run_id"], ["runs.run_id"], name="fk_uploads_run_id", ondelete="CASCADE"),
    )
    op.create_table(
        "audit",
        sa.Column("id", _IDENTIFIER, nullable=False),
        sa.Column("at", sa.Text(), nullable=False),
        sa.Column("action", sa.Text(), nullable=False),
        sa.Column("subject", sa.Text(), nullable=False),
        sa.Column("token_id", sa.Text(), nullable=False),
        sa.Column("address", sa.Text(), nullable=False),
        sa.Column("detail", sa.Text(), nullable=False),
        sa.PrimaryKeyConstraint("id", name="pk_audit"),
    )
    for name in ("view_key", "technique_key"):
        op.add_column("rows", sa.Column(name, sa.Text(), nullable=False, server_default=""))
    _fill_in()
    op.create_index("ix_runs_created_at", "runs", ["created_at"])
    op.create_index("ix_rows_run_id_outcome", "rows", ["run_id", "outcome"])
    op.create_index(
        "ix_rows_leaderboard",
        "rows",
        ["experiment", "view_key", "technique_key", "machine", "code_version", "measured_at"],
    )
    op.create_index("ix_rows_history", "rows", ["method", "experiment", "view_key", "measured_at"])


def _fill_in() -> None:
    connection = op.get_bind()
    # JSON is named as such, so that both databases give it back decoded
    json_columns = {"scene_parameters", "method_parameters"}
    rows = sa.table(
        "rows",
        sa.column("id", _IDENTIFIER),
        sa.column("view_key", sa.Text()),
        sa.column("technique_key", sa.Text()),
        *(sa.column(name, sa.JSON() if name in json_columns else None) for name in (*_VIEW, *_TECHNIQUE)),
    )
    last = -1
    while True:
        wanted = sa.select(rows).where(rows.c.id > last).order_by(rows.c.id).limit(_AT_ONCE)
        found = connection.execute(wanted).mappings().all()
        if not found:
            return
        last = found[-1]["id"]
        changed = rows.update().where(rows.c.id == sa.bindparam("row"))
        changed = changed.values(view_key=sa.bindparam("view"), technique_key=sa.bindparam("technique"))
        lines = [{"row": row["id"], "view": _hash(row, _VIEW), "technique": _hash(row, _TECHNIQUE)} for row in found]
        connection.execute(changed, lines)


def _hash(row: sa.RowMapping, names: tuple[str, ...]) -> str:
    text = json.dumps([row[name] for name in names], sort_keys=True, ensure_ascii=True)
    return hashlib.sha256(text.encode("ascii")).hexdigest()[:16]
