"""Runs, rows and the long tables beside them.

Revision ID: 0001
Revises:
"""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision: str = "0001"
down_revision: str | None = None
branch_labels: str | None = None
depends_on: str | None = None

_IDENTIFIER = sa.BigInteger().with_variant(sa.Integer(), "sqlite")


def upgrade() -> None:
    """Make all tables."""
    op.create_table(
        "runs",
        sa.Column("id", _IDENTIFIER, nullable=False),
        sa.Column("run_id", sa.Text(), nullable=False),
        sa.Column("plan_key", sa.Text(), nullable=False),
        sa.Column("title", sa.Text(), nullable=False),
        sa.Column("experiments", sa.JSON(), nullable=False),
        sa.Column("argv", sa.JSON(), nullable=False),
        sa.Column("created_at", sa.Text(), nullable=False),
        sa.Column("finished_at", sa.Text(), nullable=True),
        sa.Column("status", sa.Text(), nullable=False),
        sa.Column("case_count", sa.BigInteger(), nullable=False),
        sa.Column("machine", sa.Text(), nullable=False),
        sa.Column("environment", sa.JSON(), nullable=False),
        sa.Column("code_version", sa.Text(), nullable=False),
        sa.Column("definitions", sa.JSON(), nullable=False),
        sa.Column("method_defaults", sa.JSON(), nullable=False),
        sa.PrimaryKeyConstraint("id", name="pk_runs"),
    )
    op.create_index("ix_runs_run_id", "runs", ["run_id"], unique=True)
    op.create_index("ix_runs_plan_key", "runs", ["plan_key"])
    op.create_table(
        "rows",
        sa.Column("id", _IDENTIFIER, nullable=False),
        sa.Column("run_id", sa.Text(), nullable=False),
        sa.Column("experiment", sa.Text(), nullable=False),
        sa.Column("comparison", sa.Text(), nullable=False),
        sa.Column("case_key", sa.Text(), nullable=False),
        sa.Column("quality_key", sa.Text(), nullable=False),
        sa.Column("scene", sa.Text(), nullable=False),
        sa.Column("scene_parameters", sa.JSON(), nullable=False),
        sa.Column("triangles", sa.BigInteger(), nullable=True),
        sa.Column("method", sa.Text(), nullable=False),
        sa.Column("method_title", sa.Text(), nullable=False),
        sa.Column("method_parameters", sa.JSON(), nullable=False),
        sa.Column("light", sa.Text(), nullable=False),
        sa.Column("camera", sa.Text(), nullable=False),
        sa.Column("width", sa.BigInteger(), nullable=False),
        sa.Column("height", sa.BigInteger(), nullable=False),
        sa.Column("device", sa.Text(), nullable=False),
        sa.Column("threads", sa.BigInteger(), nullable=False),
        sa.Column("outcome", sa.Text(), nullable=False),
        sa.Column("reason", sa.Text(), nullable=False),
        sa.Column("stderr_tail", sa.Text(), nullable=False),
        sa.Column("warnings", sa.JSON(), nullable=False),
        sa.Column("receivers", sa.BigInteger(), nullable=True),
        sa.Column("scored", sa.BigInteger(), nullable=True),
        sa.Column("self_hit", sa.Text(), nullable=False),
        sa.Column("visibility_digest", sa.Text(), nullable=False),
        sa.Column("rounds", sa.BigInteger(), nullable=True),
        sa.Column("build_ms", sa.Double(), nullable=True),
        sa.Column("build_ms_low", sa.Double(), nullable=True),
        sa.Column("build_ms_high", sa.Double(), nullable=True),
        sa.Column("shade_ms", sa.Double(), nullable=True),
        sa.Column("shade_ms_low", sa.Double(), nullable=True),
        sa.Column("shade_ms_high", sa.Double(), nullable=True),
        sa.Column("camera_ms", sa.Double(), nullable=True),
        sa.Column("camera_ms_low", sa.Double(), nullable=True),
        sa.Column("camera_ms_high", sa.Double(), nullable=True),
        sa.Column("static_frame_ms", sa.Double(), nullable=True),
        sa.Column("static_frame_ms_low", sa.Double(), nullable=True),
        sa.Column("static_frame_ms_high", sa.Double(), nullable=True),
        sa.Column("dynamic_frame_ms", sa.Double(), nullable=True),
        sa.Column("dynamic_frame_ms_low", sa.Double(), nullable=True),
        sa.Column("dynamic_frame_ms_high", sa.Double(), nullable=True),
        sa.Column("compile_ms", sa.Double(), nullable=True),
        sa.Column("bytes_kept", sa.BigInteger(), nullable=True),
        sa.Column("peak_rss_bytes", sa.BigInteger(), nullable=True),
        sa.Column("false_lit_percent", sa.Double(), nullable=True),
        sa.Column("false_lit_count", sa.BigInteger(), nullable=True),
        sa.Column("false_shadow_percent", sa.Double(), nullable=True),
        sa.Column("false_shadow_count", sa.BigInteger(), nullable=True),
        sa.Column("failure_percent", sa.Double(), nullable=True),
        sa.Column("failure_count", sa.BigInteger(), nullable=True),
        sa.Column("classified_percent", sa.Double(), nullable=True),
        sa.Column("classified_count", sa.BigInteger(), nullable=True),
        sa.Column("acne_percent", sa.Double(), nullable=True),
        sa.Column("acne_count", sa.BigInteger(), nullable=True),
        sa.Column("peter_panning_percent", sa.Double(), nullable=True),
        sa.Column("peter_panning_count", sa.BigInteger(), nullable=True),
        sa.Column("edge_band_percent", sa.Double(), nullable=True),
        sa.Column("edge_band_count", sa.BigInteger(), nullable=True),
        sa.Column("interior_percent", sa.Double(), nullable=True),
        sa.Column("interior_count", sa.BigInteger(), nullable=True),
        sa.Column("turned_away_percent", sa.Double(), nullable=True),
        sa.Column("turned_away_count", sa.BigInteger(), nullable=True),
        sa.Column("rmse", sa.Double(), nullable=True),
        sa.Column("ssim", sa.Double(), nullable=True),
        sa.Column("flip", sa.Double(), nullable=True),
        sa.Column("leak_mean", sa.Double(), nullable=True),
        sa.Column("leak_p99", sa.Double(), nullable=True),
        sa.Column("reference_error", sa.Double(), nullable=True),
        sa.Column("machine", sa.Text(), nullable=False),
        sa.Column("environment", sa.JSON(), nullable=False),
        sa.Column("code_version", sa.Text(), nullable=False),
        sa.Column("measured_at", sa.Text(), nullable=False),
        sa.PrimaryKeyConstraint("id", name="pk_rows"),
        sa.ForeignKeyConstraint(["run_id"], ["runs.run_id"], name="fk_rows_run_id", ondelete="CASCADE"),
    )
    op.create_index("ix_rows_run_id_experiment_case_key", "rows", ["run_id", "experiment", "case_key"], unique=True)
    op.create_index("ix_rows_case_key", "rows", ["case_key"])
    _create_long_table("stages", sa.Column("value", sa.Double(), nullable=True))
    _create_long_table("counters", sa.Column("value", sa.BigInteger(), nullable=False))
    _create_long_table("kept", sa.Column("value", sa.BigInteger(), nullable=False))
    _create_long_table(
        "samples",
        sa.Column("round", sa.BigInteger(), nullable=False),
        sa.Column("value", sa.Double(), nullable=True),
        key=("row_id", "position", "round"),
    )
    _create_long_table("artifacts", sa.Column("value", sa.Text(), nullable=False))


def _create_long_table(name: str, *columns: sa.Column[object], key: tuple[str, ...] = ("row_id", "position")) -> None:
    op.create_table(
        name,
        sa.Column("row_id", _IDENTIFIER, nullable=False),
        sa.Column("position", sa.BigInteger(), nullable=False),
        sa.Column("name", sa.Text(), nullable=False),
        *columns,
        sa.Column("unit", sa.Text(), nullable=False),
        sa.PrimaryKeyConstraint(*key, name=f"pk_{name}"),
        sa.ForeignKeyConstraint(["row_id"], ["rows.id"], name=f"fk_{name}_row_id", ondelete="CASCADE"),
        sqlite_with_rowid=False,
    )
