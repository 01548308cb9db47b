"""The database's columns are the result row's and the run record's, in the models and after the migrations."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from alembic.autogenerate import compare_metadata
from alembic.config import Config
from alembic.migration import MigrationContext
from alembic.script import ScriptDirectory
from pydantic import BaseModel
from sqlalchemy import inspect

from shadowbench import store as store_package
from shadowbench.rows import LONG_FIELDS, LONG_UNITS, ResultRow, RunRecord
from shadowbench.store import (
    Store,
    access_models,  # noqa: F401 - registers its tables
)
from shadowbench.store.models import LONG_MODELS, Base, StoredRow, StoredRun, derived_columns
from shadowbench.store.schema import REVISIONS


def test_every_field_of_a_row_is_a_column_or_a_long_table() -> None:
    columns = {column.name for column in StoredRow.__table__.columns}
    assert columns - {"id", "view_key", "technique_key"} == set(ResultRow.model_fields) - set(LONG_FIELDS)
    assert set(LONG_MODELS) == set(LONG_FIELDS) == set(LONG_UNITS)


def test_every_field_of_a_run_is_a_column() -> None:
    assert {column.name for column in StoredRun.__table__.columns} - {"id"} == set(RunRecord.model_fields)


def test_migrations_make_exactly_what_the_models_say(tmp_path: Path) -> None:
    with Store.open(tmp_path) as store, store.engine.connect() as connection:
        context = MigrationContext.configure(connection, opts={"compare_type": True})
        assert compare_metadata(context, Base.metadata) == []
        for table in Base.metadata.tables.values():
            assert inspect(connection).get_pk_constraint(table.name)["constrained_columns"] == [
                column.name for column in table.primary_key
            ]


def test_the_known_revisions_are_those_in_the_migrations_folder() -> None:
    configuration = Config()
    folder = Path(str(store_package.__file__)).parent / "migrations"
    configuration.set_main_option("script_location", str(folder))
    scripts = ScriptDirectory.from_config(configuration)
    assert [script.revision for script in scripts.walk_revisions()] == list(reversed(REVISIONS))
    files = [file.name for file in (folder / "versions").glob("*.py") if file.name != "__init__.py"]
    assert sorted(re.sub(r"^r(\d{4})_\w+\.py$", r"\1", name) for name in files) == sorted(REVISIONS)


def test_a_field_that_no_column_can_hold_is_refused_at_import() -> None:
    class Odd(BaseModel):
        value: complex

    class Undecided(BaseModel):
        value: int | str

    for model in (Odd, Undecided):
        with pytest.raises(TypeError, match="field 'value'"):
            derived_columns(model)
