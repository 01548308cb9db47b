"""Where a row's measures come from, and how many receivers changed between repeats.

Revision ID: 0007
Revises: 0005
"""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision: str = "0007"
down_revision: str | None = "0005"
branch_labels: str | None = None
depends_on: str | None = None


def upgrade() -> None:
    """Add two columns and an index; every row so far was measured by its own run."""
    op.add_column("rows", sa.Column("quality_run", sa.Text(), nullable=False, server_default=""))
    op.add_column("rows", sa.Column("changed_count", sa.BigInteger(), nullable=True))
    op.create_index("ix_rows_quality_key", "rows", ["quality_key"])
