"""The database's tables as SQLAlchemy models; only the store and its migrations touch them.

The columns of ``runs`` and ``rows`` are derived from :class:`~shadowbench.rows.RunRecord` and
:class:`~shadowbench.rows.ResultRow`, so that a field cannot be forgotten: adding one there makes the test that
compares the migrated database with these models ask for a migration. Two columns of a row are hashes that lists are
grouped by, and ``standings`` holds copies (:mod:`shadowbench.store.derived`). What has many values a row (stages,
counters, kept arrays, samples, artifacts) stands in a long table of its own: ``row_id, position, name, value, unit``,
where ``position`` keeps the order in which a method named them, and samples have a ``round``. In SQL::

    SELECT r.method, s.name, s.value, s.unit FROM stages s JOIN rows r ON r.id = s.row_id WHERE r.run_id = ?
"""

from __future__ import annotations

import types
from enum import StrEnum
from typing import Any, ClassVar, Union, get_args, get_origin

from pydantic import BaseModel
from sqlalchemy import (
    JSON,
    BigInteger,
    Column,
    Double,
    ForeignKey,
    ForeignKeyConstraint,
    Index,
    Integer,
    MetaData,
    PrimaryKeyConstraint,
    Table,
    Text,
)
from sqlalchemy.orm import DeclarativeBase, Mapped, mapped_column
from sqlalchemy.types import TypeEngine

from shadowbench.rows import LONG_FIELDS, ResultRow, RunRecord
from shadowbench.store.derived import STANDING_COLUMNS, STANDING_KEY

_Identifier = BigInteger().with_variant(Integer(), "sqlite")  # only INTEGER PRIMARY KEY counts by itself in SQLite


class Base(DeclarativeBase):
    """The registry of all models. Constraints have names, which a later migration needs to change them."""

    metadata = MetaData(
        naming_convention={
            "pk": "pk_%(table_name)s",
            "fk": "fk_%(table_name)s_%(column_0_name)s",
            "ix": "ix_%(table_name)s_%(column_0_N_name)s",
            "uq": "uq_%(table_name)s_%(column_0_N_name)s",
        }
    )
    type_annotation_map: ClassVar[dict[Any, Any]] = {str: Text(), float: Double(), int: BigInteger()}


def derived_columns(model: type[BaseModel], *, without: tuple[str, ...] = ()) -> list[Column[Any]]:
    """Return one column per field of ``model``: text, whole and real numbers as such, lists and mappings as JSON."""
    return [_column(name, field.annotation) for name, field in model.model_fields.items() if name not in without]


def _column(name: str, annotation: Any) -> Column[Any]:
    alternatives = get_args(annotation) if get_origin(annotation) in (Union, types.UnionType) else (annotation,)
    plain = [alternative for alternative in alternatives if alternative is not type(None)]
    if len(plain) != 1:
        raise TypeError(f"field '{name}' has {len(plain)} types; a column has one")
    return Column(name, _column_type(name, plain[0]), nullable=len(plain) < len(alternatives))


def _column_type(name: str, kind: Any) -> TypeEngine[Any]:
    if get_origin(kind) in (dict, list):
        return JSON()
    if kind is str or (isinstance(kind, type) and issubclass(kind, StrEnum)):
        return Text()
    if kind is int:
        return BigInteger()
    if kind is float:
        return Double()
    raise TypeError(f"field '{name}' is of type {kind!r}, for which the store has no column type")


class StoredRun(Base):
    """A :class:`~shadowbench.rows.RunRecord`; ``id`` grows in the order in which runs were begun."""

    __table__ = Table(
        "runs",
        Base.metadata,
        Column("id", _Identifier, primary_key=True),
        *derived_columns(RunRecord),
        Index(None, "run_id", unique=True),
        Index(None, "plan_key"),
        Index(None, "created_at"),
    )


class StoredRow(Base):
    """A :class:`~shadowbench.rows.ResultRow` without its long fields; ``id`` grows in the order of adding."""

    __table__ = Table(
        "rows",
        Base.metadata,
        Column("id", _Identifier, primary_key=True),
        *derived_columns(ResultRow, without=LONG_FIELDS),
        *(Column(name, Text(), nullable=False, server_default="") for name in ("view_key", "technique_key")),
        ForeignKeyConstraint(["run_id"], ["runs.run_id"], ondelete="CASCADE"),
        Index(None, "run_id", "experiment", "case_key", unique=True),
        Index(None, "case_key"),
        Index(None, "run_id", "outcome"),
        Index(
            "ix_rows_leaderboard",
            *("experiment", "view_key", "technique_key", "machine", "code_version", "measured_at"),
        ),
        Index("ix_rows_history", "method", "experiment", "view_key", "measured_at"),
        Index(None, "quality_key"),
    )


class StoredStanding(Base):
    """Which row stands for a technique on a machine in a version, and what a leaderboard shows of it.

    Only :mod:`shadowbench.store.standings` writes here.
    """

    __table__ = Table(
        "standings",
        Base.metadata,
        *(Column(name, Text(), nullable=False) for name in STANDING_KEY),
        Column("row_id", _Identifier, nullable=False),
        *(column for column in derived_columns(ResultRow, without=LONG_FIELDS) if column.name in STANDING_COLUMNS),
        PrimaryKeyConstraint(*STANDING_KEY),
        ForeignKeyConstraint(["row_id"], ["rows.id"], ondelete="CASCADE"),
        Index(None, "row_id"),
        Index("ix_standings_places", "experiment", "view_key", "code_version", "machine", "measured_at"),
        Index("ix_standings_techniques", "experiment", "view_key", "technique_key"),
        sqlite_with_rowid=False,  # clustered by the key: a version's standings of a view lie side by side
    )


class _LongValue:
    """What the long tables share."""

    row_id: Mapped[int] = mapped_column(ForeignKey("rows.id", ondelete="CASCADE"), primary_key=True, sort_order=-4)
    position: Mapped[int] = mapped_column(primary_key=True, sort_order=-3)
    name: Mapped[str] = mapped_column(sort_order=-2)
    unit: Mapped[str] = mapped_column(sort_order=1)

    __table_args__: ClassVar[Any] = {"sqlite_with_rowid": False}  # clustered by row_id, one copy of the key


class StoredStage(_LongValue, Base):
    """A stage's median duration [ms]; null where it is not a number."""

    __tablename__ = "stages"
    value: Mapped[float | None]


class StoredCounter(_LongValue, Base):
    """A work counter."""

    __tablename__ = "counters"
    value: Mapped[int]


class StoredKept(_LongValue, Base):
    """The size of an array that stays alive between frames [bytes]."""

    __tablename__ = "kept"
    value: Mapped[int]


class StoredSample(_LongValue, Base):
    """One duration of one round [ms]; null where it is not a number."""

    __tablename__ = "samples"
    round: Mapped[int] = mapped_column(primary_key=True, sort_order=-1)
    value: Mapped[float | None]


class StoredArtifact(_LongValue, Base):
    """The file that holds a picture or mask."""

    __tablename__ = "artifacts"
    value: Mapped[str]


LONG_MODELS: dict[str, type[_LongValue]] = {
    "stages": StoredStage,
    "counters": StoredCounter,
    "kept": StoredKept,
    "samples": StoredSample,
    "artifacts": StoredArtifact,
}
