"""Errors in the edge band and the interior, and a filter's approximation apart from its map's texels.

Revision ID: 0003
Revises: 0002
"""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision: str = "0003"
down_revision: str | None = "0002"
branch_labels: str | None = None
depends_on: str | None = None


def upgrade() -> None:
    """Add four columns; no row so far has these measures."""
    for name in ("edge_band_rmse", "interior_rmse", "approximation_rmse", "discretisation_rmse"):
        op.add_column("rows", sa.Column(name, sa.Double(), nullable=True))
