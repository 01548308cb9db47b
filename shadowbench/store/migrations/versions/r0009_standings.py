"""What leaderboards show, kept beside the rows.

Revision ID: 0009
Revises: 0008
"""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision: str = "0009"
down_revision: str | None = "0008"
branch_labels: str | None = None
depends_on: str | None = None

_IDENTIFIER = sa.BigInteger().with_variant(sa.Integer(), "sqlite")
_KEY = ("experiment", "view_key", "code_version", "machine", "technique_key")
_TEXTS = ("run_id", "case_key", "outcome", "reason", "visibility_digest")
_TIMES = ("build_ms", "shade_ms", "static_frame_ms", "dynamic_frame_ms")
_NUMBERS = (
    *(f"{name}{end}" for name in _TIMES for end in ("", "_low", "_high")),
    *("false_lit_percent", "false_shadow_percent", "failure_percent", "acne_percent", "peter_panning_percent"),
    *("rmse", "ssim", "flip", "leak_mean"),
)
_COPIED = (*_TEXTS, *_NUMBERS, "bytes_kept", "measured_at")


def upgrade() -> None:
    """Make the table and fill it in from the rows that are there."""
    op.create_table(
        "standings",
        *(sa.Column(name, sa.Text(), nullable=False) for name in _KEY),
        sa.Column("row_id", _IDENTIFIER, nullable=False),
        *(sa.Column(name, sa.Text(), nullable=False) for name in _TEXTS),
        *(sa.Column(name, sa.Double(), nullable=True) for name in _NUMBERS),
        sa.Column("bytes_kept", sa.BigInteger(), nullable=True),
        sa.Column("measured_at", sa.Text(), nullable=False),
        sa.PrimaryKeyConstraint(*_KEY, name="pk_standings"),
        sa.ForeignKeyConstraint(["row_id"], ["rows.id"], name="fk_standings_row_id", ondelete="CASCADE"),
        sqlite_with_rowid=False,
    )
    _fill_in()
    op.create_index("ix_standings_row_id", "standings", ["row_id"])
    places = ["experiment", "view_key", "code_version", "machine", "measured_at"]
    op.create_index("ix_standings_places", "standings", places)
    op.create_index("ix_standings_techniques", "standings", ["experiment", "view_key", "technique_key"])


def _fill_in() -> None:
    rows = sa.table("rows", *(sa.column(name) for name in ("id", *_KEY, *_COPIED)))
    standings = sa.table("standings", *(sa.column(name) for name in (*_KEY, "row_id", *_COPIED)))
    newest_first = (rows.c.measured_at.desc(), rows.c.id.desc())
    place = sa.func.row_number().over(partition_by=[rows.c[name] for name in _KEY], order_by=newest_first)
    ranked = sa.select(rows.c.id, place.label("place")).subquery()
    newest = sa.select(*(rows.c[name] for name in (*_KEY, "id", *_COPIED))).join(ranked, ranked.c.id == rows.c.id)
    op.execute(standings.insert().from_select([*_KEY, "row_id", *_COPIED], newest.where(ranked.c.place == 1)))
