"""How many samples a pixel has and how many surfaces a sample sees.

Revision ID: 0002
Revises: 0001
"""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision: str = "0002"
down_revision: str | None = "0001"
branch_labels: str | None = None
depends_on: str | None = None


def upgrade() -> None:
    """Add two columns; every row so far had one of each."""
    for name in ("pixel_samples", "layers"):
        op.add_column("rows", sa.Column(name, sa.BigInteger(), nullable=False, server_default="1"))
