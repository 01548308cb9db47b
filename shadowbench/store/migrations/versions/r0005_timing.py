"""How each time was taken: processes, repeats, warming up, what ended the rounds, outliers, and the unexplained rest.

Revision ID: 0005
Revises: 0004
"""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision: str = "0005"
down_revision: str | None = "0004"
branch_labels: str | None = None
depends_on: str | None = None


def upgrade() -> None:
    """Add nine columns; of rows so far nothing is known but that one process timed them."""
    for name in ("baseline_case", "ended_by"):
        op.add_column("rows", sa.Column(name, sa.Text(), nullable=False, server_default=""))
    for name in ("round_processes", "outlier_rounds"):
        op.add_column("rows", sa.Column(name, sa.JSON(), nullable=False, server_default="[]"))
    for name in ("processes", "warm_up_frames", "build_repeats", "shade_repeats"):
        op.add_column("rows", sa.Column(name, sa.BigInteger(), nullable=True))
    op.add_column("rows", sa.Column("unexplained_ms", sa.Double(), nullable=True))
