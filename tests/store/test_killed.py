"""``kill -9`` at any moment: a row is there wholly or not at all, and what was acknowledged is there."""

from __future__ import annotations

import random
import signal
import sqlite3
import subprocess
import sys
from contextlib import closing
from pathlib import Path

import pytest

from shadowbench.store import DATABASE_NAME, Store
from shadowbench.store.models import LONG_MODELS

WRITER = """
import os, signal, sys
from pathlib import Path
from sqlalchemy import event
from shadowbench.rows import ResultRow, RunRecord
from shadowbench.store import Store

folder, statements_until_death = Path(sys.argv[1]), int(sys.argv[2])
store = Store.open(folder)
store.start_run(RunRecord(run_id="run", created_at="2026-01-01T00:00:00+00:00"))
left = statements_until_death


def die(*_):
    global left
    left -= 1
    if left == 0:
        os.kill(os.getpid(), signal.SIGKILL)


event.listen(store.engine, "before_cursor_execute" if sys.argv[3] == "before" else "after_cursor_execute", die)
event.listen(store.engine, "commit", die)  # before the commit itself
for case in range(20):
    store.add_row(
        ResultRow(
            run_id="run", experiment="quick", case_key=str(case), quality_key="q", scene="s", method="m", light="l",
            camera="c", width=1, height=1, device="cpu", threads=1, outcome="ok", stages={"a": 1.0, "b": 2.0},
            counters={"n": 3}, kept={"map": 4}, samples={"build": [1.0] * 50, "shade": [2.0] * 50},
            artifacts={"mask": "file"},
        )
    )
    print(case, flush=True)
"""


def _killed_writer(folder: Path, *arguments: str) -> list[str]:
    """Run the writer until it dies and return the cases that it knew to be stored."""
    done = subprocess.run(
        [sys.executable, "-c", WRITER, str(folder), *arguments], capture_output=True, text=True, check=False, timeout=60
    )
    assert done.returncode == -signal.SIGKILL, done.stderr
    return done.stdout.split()


def _check_whole(folder: Path, acknowledged: list[str]) -> None:
    with Store.open(folder) as store:
        rows = store.rows("run")
        assert {row.case_key for row in rows} >= set(acknowledged)
        assert len(rows) <= len(acknowledged) + 1
        for row in rows:
            assert (row.stages, row.counters, row.kept) == ({"a": 1.0, "b": 2.0}, {"n": 3}, {"map": 4})
            assert row.samples == {"build": [1.0] * 50, "shade": [2.0] * 50}
            assert row.artifacts == {"mask": "file"}
    with closing(sqlite3.connect(folder / DATABASE_NAME)) as connection:
        assert connection.execute("PRAGMA integrity_check").fetchall() == [("ok",)]
        for table in LONG_MODELS:
            orphans = f"SELECT count(*) FROM {table} WHERE row_id NOT IN (SELECT id FROM rows)"
            assert connection.execute(orphans).fetchone() == (0,)


@pytest.mark.parametrize(("statement", "moment"), [(14, "before"), (27, "after")])
def test_a_writer_killed_in_mid_transaction_leaves_whole_rows_only(tmp_path: Path, statement: int, moment: str) -> None:
    _check_whole(tmp_path, _killed_writer(tmp_path, str(statement), moment))


@pytest.mark.slow
def test_a_writer_killed_at_any_statement_leaves_whole_rows_only(tmp_path: Path) -> None:
    moments = random.Random(1)
    for attempt in range(12):
        folder = tmp_path / str(attempt)
        where = moments.choice(("before", "after"))
        _check_whole(folder, _killed_writer(folder, str(moments.randrange(1, 150)), where))


def test_killing_while_the_database_is_made_leaves_one_that_opens(tmp_path: Path) -> None:
    program = (
        "import os, signal, sys; from pathlib import Path\n"
        "from shadowbench.store import Store, schema\n"
        "made = schema.upgrade\n"
        "def upgrade(connection):\n"
        "    made(connection); os.kill(os.getpid(), signal.SIGKILL)\n"
        "schema.upgrade = upgrade\n"
        "Store.open(Path(sys.argv[1]))\n"
    )
    done = subprocess.run([sys.executable, "-c", program, str(tmp_path)], check=False, timeout=60)
    assert done.returncode == -signal.SIGKILL
    with closing(sqlite3.connect(tmp_path / DATABASE_NAME)) as connection:
        assert connection.execute("SELECT name FROM sqlite_master").fetchall() == []
    with Store.open(tmp_path) as store:
        assert store.runs() == []
