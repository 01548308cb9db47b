"""What moves between two frames of a case.

Revision ID: 0004
Revises: 0003
"""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision: str = "0004"
down_revision: str | None = "0003"
branch_labels: str | None = None
depends_on: str | None = None


def upgrade() -> None:
    """Add a column; so far methods were told that everything had moved."""
    op.add_column("rows", sa.Column("moving", sa.Text(), nullable=False, server_default="everything"))
