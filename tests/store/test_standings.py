"""Standings are those of the rows that are there, however these came and went."""

from __future__ import annotations

import random
from pathlib import Path
from typing import Any

from sqlalchemy import select
from stored_rows import some_row, some_run

from shadowbench.rows import ResultRow
from shadowbench.store import Store
from shadowbench.store.derived import STANDING_COLUMNS, STANDING_KEY
from shadowbench.store.engine import writing
from shadowbench.store.models import StoredRow, StoredStanding
from shadowbench.store.transfer import export_runs, import_runs
from shadowbench.store.uploads import Uploader, put_run


def expected(store: Store) -> dict[tuple[str, ...], dict[str, Any]]:
    """What stands for each key, found by looking at every row."""
    newest: dict[tuple[str, ...], Any] = {}
    with store.session("read all rows") as session:
        for row in session.execute(select(StoredRow.__table__)).mappings():
            key = tuple(row[name] for name in STANDING_KEY)
            if key not in newest or (row["measured_at"], row["id"]) > (newest[key]["measured_at"], newest[key]["id"]):
                newest[key] = row
    return {key: {name: row[name] for name in ("id", *STANDING_COLUMNS)} for key, row in newest.items()}


def kept(store: Store) -> dict[tuple[str, ...], dict[str, Any]]:
    """What the table of standings says."""
    with store.session("read the standings") as session:
        found = session.execute(select(StoredStanding.__table__)).mappings().all()
    values = {
        tuple(row[name] for name in STANDING_KEY): {"id": row["row_id"]} | {n: row[n] for n in STANDING_COLUMNS}
        for row in found
    }
    assert len(values) == len(found)
    return values


def random_rows(generator: random.Random, run_id: str, most: int = 12) -> list[ResultRow]:
    """Rows that meet those of other runs, and each other, in few keys."""
    return [
        some_row(
            generator.choice(("pcf", "esm")),
            run_id=run_id,
            case_key=f"case-{number}",
            experiment=generator.choice(("quick", "other")),
            scene=generator.choice(("bunny", "fence")),
            machine=generator.choice("ab"),
            code_version=generator.choice("12"),
            measured_at=f"2026-01-0{generator.randint(1, 4)}T00:00:00+00:00",
            outcome=generator.choice(("ok", "ok", "crash")),
            reason=generator.choice(("", "why")),
            rmse=generator.choice((None, generator.random())),
            bytes_kept=generator.choice((None, 2**40)),
        )
        for number in range(generator.randint(0, most))
    ]


def test_standings_follow_uploads_replaced_runs_and_cases_measured_again(store: Store, tmp_path: Path) -> None:
    generator = random.Random(8)
    anna = Uploader("anna")
    store.start_run(some_run(run_id="local"))
    with Store.open(tmp_path / "elsewhere") as elsewhere:
        run = some_run(run_id="imported")
        put_run(elsewhere, run, random_rows(generator, run.run_id), anna)
        export_runs(elsewhere, [run], tmp_path / "runs.zip", as_csv=lambda _: "")
    seen = 0
    for step in range(60):
        if step == 30:
            import_runs(store, tmp_path / "runs.zip")
        elif generator.random() < 0.5:
            name = f"run-{generator.randrange(6)}"  # most are there already and are replaced, also by none
            put_run(store, some_run(run_id=name, title=str(step)), random_rows(generator, name), anna)
        else:
            for row in random_rows(generator, "local", most=2):
                store.add_row(row)
        assert kept(store) == expected(store)
        seen = max(seen, len(kept(store)))
    assert seen > 25, "few keys were ever taken"


def test_a_replaced_run_lets_the_next_newest_row_stand(store: Store) -> None:
    for day, name in enumerate(("older", "newer"), 1):
        row = some_row(run_id=name, case_key=name, measured_at=f"2026-01-0{day}T00:00:00+00:00")
        put_run(store, some_run(run_id=name), [row], Uploader("anna"))
    assert [row["run_id"] for row in kept(store).values()] == ["newer"]
    put_run(store, some_run(run_id="newer"), [], Uploader("anna"))
    assert [row["run_id"] for row in kept(store).values()] == ["older"]
    put_run(store, some_run(run_id="older"), [], Uploader("anna"))
    assert kept(store) == {}


def test_the_migration_fills_in_the_standings_of_an_older_store(store: Store) -> None:
    """What it makes of the rows that are there is what keeping up with them would have made."""
    from alembic.operations import Operations
    from alembic.runtime.migration import MigrationContext

    from shadowbench.store.migrations.versions import r0009_standings

    generator = random.Random(9)
    for number in range(8):
        name = f"run-{number}"
        put_run(store, some_run(run_id=name), random_rows(generator, name), Uploader("anna"))
    with writing(store.engine).begin() as connection:
        connection.exec_driver_sql("DROP TABLE standings")
        with Operations.context(MigrationContext.configure(connection)):
            r0009_standings.upgrade()
    assert kept(store) == expected(store)
    assert len(kept(store)) > 10
