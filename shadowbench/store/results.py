"""The results store: runs and their rows in, runs and their rows out.

:class:`Store` is all that the rest of the program sees of the database. Each call is one transaction; a call that
writes has its effect on the disk before it returns. A store may be used from several threads, and a folder from
several processes; a store that was opened before a ``fork`` must not be used after it.
"""

from __future__ import annotations

import datetime as dt
import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from sqlalchemy import Engine, func, insert, select, update
from sqlalchemy.orm import Session

from shadowbench.errors import StoreError, did_you_mean
from shadowbench.rows import Outcome, ResultRow, RunRecord, RunStatus
from shadowbench.store.artifacts import ArtifactFolder
from shadowbench.store.engine import make_engine, make_server_engine, server_url, store_errors, writing
from shadowbench.store.inserting import insert_rows
from shadowbench.store.models import LONG_MODELS, StoredRow, StoredRun
from shadowbench.store.records import row_from, row_values, run_from, run_values
from shadowbench.store.schema import ensure_current
from shadowbench.store.standings import delete_rows

DATABASE_NAME = "results.sqlite"

LATEST = "latest"
"""The selector of the newest run."""

_KEYS_AT_ONCE = 500
"""In one statement; databases take some thousands."""

_RUNS = StoredRun.__table__.c
_ROWS = StoredRow.__table__.c


class Store:
    """An open results folder. Made by :meth:`open`; closed by :meth:`close` or the end of a ``with`` block."""

    def __init__(self, folder: Path, engine: Engine, place: Path | str) -> None:
        """Use a database that is up to date; everybody else calls :meth:`open`.

        Args:
            folder: The results folder.
            engine: The database.
            place: What messages call it: the file, or the server's address without its password.
        """
        self.folder = folder
        self.artifacts = ArtifactFolder(folder / "artifacts")
        self.place = place
        self.engine = engine

    @classmethod
    def open(cls, folder: Path, *, create: bool = True, database: str | None = None) -> Store:
        """Open a results folder; an older database is upgraded.

        Args:
            folder: The results folder.
            create: Make folder and database if they are missing, and demand that they can be written to. Without it a
                folder that may only be read is opened for reading.
            database: Address of a PostgreSQL database that holds the runs instead of the folder's SQLite file; pictures
                and masks are in the folder all the same.

        Raises:
            StoreError: The folder or its database is missing, cannot be opened, or belongs to something else.
        """
        if folder.exists() and not folder.is_dir():
            raise StoreError(f"{folder}: is a file, not a results folder")
        if database is not None:
            return cls._open_server(folder, database)
        return cls._open_file(folder, folder / DATABASE_NAME, create=create)

    @classmethod
    def _open_server(cls, folder: Path, address: str) -> Store:
        url = server_url(address)
        with store_errors(folder, "make the results folder"):
            folder.mkdir(parents=True, exist_ok=True)
        return cls._opened(folder, make_server_engine(url), url.render_as_string(hide_password=True), read_only=False)

    @classmethod
    def _open_file(cls, folder: Path, database: Path, *, create: bool) -> Store:
        if not create and not database.exists():
            raise StoreError(
                f"{folder}: holds no results; `shadowbench run` makes some, --results names another folder"
            )
        if create:
            with store_errors(folder, "make the results folder"):
                folder.mkdir(parents=True, exist_ok=True)
        read_only = not all(
            os.access(path, os.W_OK, effective_ids=True) for path in (folder, database) if path.exists()
        )
        if read_only and create:
            raise StoreError(f"{folder}: may only be read; give another folder with --results")
        return cls._opened(folder, make_engine(database, read_only=read_only), database, read_only=read_only)

    @classmethod
    def _opened(cls, folder: Path, engine: Engine, place: Path | str, *, read_only: bool) -> Store:
        try:
            with store_errors(place, "open the results"):
                ensure_current(engine, place, read_only=read_only)
        except BaseException:
            engine.dispose()
            raise
        return cls(folder, engine, place)

    def close(self) -> None:
        """Close the database; closing twice does no harm."""
        self.engine.dispose()

    def __enter__(self) -> Self:
        """Return the store."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close the store."""
        self.close()

    @contextmanager
    def session(self, action: str, *, writes: bool = False) -> Iterator[Session]:
        """Open one transaction, for the modules of this package; it is committed when the block ends.

        Args:
            action: What is done, for the message if it fails: ``"add a row"``.
            writes: Whether it writes; one such transaction at a time is open.
        """
        engine = writing(self.engine) if writes else self.engine
        with store_errors(self.place, action), Session(engine) as session, session.begin():
            yield session

    # Runs

    def start_run(self, run: RunRecord) -> None:
        """Record a run. One that is there already is continued: its record is replaced and its rows stay.

        A run that is running has no end, whatever its record says of an earlier one.

        Raises:
            StoreError: The id belongs to a run with another plan, or the record cannot be written.
        """
        with self.session("record the run", writes=True) as session:
            values = run_values(run)
            if run.status is RunStatus.RUNNING:
                values["finished_at"] = None
            known = session.execute(select(_RUNS.plan_key).where(_RUNS.run_id == values["run_id"])).scalar()
            if known is None:
                session.execute(insert(StoredRun).values(values))
            elif known == run.plan_key:
                session.execute(update(StoredRun).where(_RUNS.run_id == values["run_id"]).values(values))
            else:
                raise StoreError(f"{self.place}: run '{run.run_id}' is there already and has another plan")

    def finish_run(self, run_id: str, status: RunStatus, finished_at: str | None = None) -> None:
        """Record how and when (by default now) a run ended.

        Raises:
            StoreError: There is no such run, or it cannot be written.
        """
        end = finished_at or dt.datetime.now(dt.UTC).isoformat(timespec="seconds")
        with self.session("record the run's end", writes=True) as session:
            values = {"status": RunStatus(status).value, "finished_at": end}
            done = session.execute(update(StoredRun).where(_RUNS.run_id == run_id).values(values))
            if done.rowcount == 0:  # type: ignore[attr-defined]
                raise StoreError(f"{self.place}: has no run '{run_id}'")

    def runs(self) -> list[RunRecord]:
        """Return all runs, newest first."""
        return self._runs()

    def run(self, run_id: str) -> RunRecord | None:
        """Return the run with this id, or ``None``."""
        return next(iter(self._runs(_RUNS.run_id == run_id)), None)

    def find_run(self, selector: str) -> RunRecord:
        """Return the run that a user names by its id, a unique beginning of it, or ``latest``.

        Raises:
            StoreError: No run or several runs are named so; the message lists what could be meant.
        """
        runs = self.runs()
        if not runs:
            raise StoreError(f"{self.folder}: holds no run yet; `shadowbench run` makes one")
        if selector == LATEST:
            return runs[0]
        found = [run for run in runs if run.run_id == selector] or [
            run for run in runs if selector and run.run_id.startswith(selector)
        ]
        if len(found) == 1:
            return found[0]
        if found:
            listed = ", ".join(run.run_id for run in found[:6]) + (", ..." if len(found) > 6 else "")
            raise StoreError(f"{len(found)} runs in {self.folder} begin with '{selector}': {listed}")
        hint = did_you_mean(selector, [*(run.run_id for run in runs), LATEST], noun="run")
        raise StoreError(f"no run in {self.folder} is called '{selector}'; {hint}")

    def last_run(self, plan_key: str) -> RunRecord | None:
        """Return the newest run of a plan, or ``None``."""
        return next(iter(self._runs(_RUNS.plan_key == plan_key)), None)

    def unfinished_run(self, plan_key: str) -> RunRecord | None:
        """Return the newest run of a plan that is not complete (running, interrupted or failed), or ``None``."""
        unfinished = _RUNS.status != RunStatus.COMPLETE.value
        return next(iter(self._runs(_RUNS.plan_key == plan_key, unfinished)), None)

    def _runs(self, *conditions: Any) -> list[RunRecord]:
        newest_first = (_RUNS.created_at.desc(), _RUNS.id.desc())
        with self.session("read the runs") as session:
            found = session.execute(select(StoredRun.__table__).where(*conditions).order_by(*newest_first))
            return [run_from(values) for values in found.mappings()]

    # Rows

    def add_row(self, row: ResultRow) -> None:
        """Keep a row with all that belongs to it: wholly or not at all, and on the disk before this returns.

        The row of a case that the same run and experiment have already takes the earlier one's place: a case that is
        measured again counts once, and the last measurement stands.

        Raises:
            StoreError: Its run was not started, or the row cannot be written.
        """
        with self.session("add a row", writes=True) as session:
            values = row_values(row)
            if session.execute(select(_RUNS.id).where(_RUNS.run_id == values["run_id"])).scalar() is None:
                raise StoreError(f"{self.place}: has no run '{row.run_id}' to add a row to")
            same_case = (
                _ROWS.run_id == values["run_id"],
                _ROWS.experiment == values["experiment"],
                _ROWS.case_key == values["case_key"],
            )
            earlier = session.execute(select(_ROWS.id).where(*same_case)).scalar()
            if earlier is not None:
                delete_rows(session, _ROWS.id == earlier)
                values["id"] = earlier
            insert_rows(session, [row], [values])

    def rows(self, run_id: str, experiment: str | None = None, case_key: str | None = None) -> list[ResultRow]:
        """Return a run's rows in the order in which their cases were first added.

        Args:
            run_id: The run's full id; one that is not there has no rows.
            experiment: Only this experiment's rows.
            case_key: Only the rows of this case, one in each experiment.
        """
        wanted = [_ROWS.run_id == run_id]
        if experiment is not None:
            wanted.append(_ROWS.experiment == experiment)
        if case_key is not None:
            wanted.append(_ROWS.case_key == case_key)
        return self._rows(*wanted)

    def latest_measured(self, quality_keys: Iterable[str], run_id: str | None = None) -> dict[str, ResultRow]:
        """Return the newest row of a measured case for each quality key that has one.

        Args:
            quality_keys: To look for.
            run_id: Only in this run.
        """
        wanted = [_ROWS.outcome == Outcome.OK.value]
        if run_id is not None:
            wanted.append(_ROWS.run_id == run_id)
        keys = sorted(set(quality_keys))
        newest: list[int] = []
        with self.session("read the rows") as session:
            for begin in range(0, len(keys), _KEYS_AT_ONCE):
                some = _ROWS.quality_key.in_(keys[begin : begin + _KEYS_AT_ONCE])
                last = select(func.max(_ROWS.id)).where(*wanted, some).group_by(_ROWS.quality_key)
                newest += session.execute(last).scalars()
        found: dict[str, ResultRow] = {}
        for begin in range(0, len(newest), _KEYS_AT_ONCE):
            rows = self._rows(_ROWS.id.in_(newest[begin : begin + _KEYS_AT_ONCE]))
            found |= {row.quality_key: row for row in rows}
        return found

    def _rows(self, *wanted: Any) -> list[ResultRow]:
        with self.session("read the rows") as session:
            long: dict[int, dict[str, list[tuple[str, Any]]]] = {}
            for table, model in LONG_MODELS.items():
                columns = model.__table__.c  # type: ignore[attr-defined]
                lines = (
                    select(columns.row_id, columns.name, columns.value)
                    .join(StoredRow.__table__, _ROWS.id == columns.row_id)
                    .where(*wanted)
                    .order_by(*model.__table__.primary_key)  # type: ignore[attr-defined]
                )
                for row_id, name, value in session.execute(lines):
                    long.setdefault(row_id, {}).setdefault(table, []).append((name, value))
            found = session.execute(select(StoredRow.__table__).where(*wanted).order_by(_ROWS.id))
            return [row_from(values, long.get(values["id"], {})) for values in found.mappings()]

    def finished_case_keys(self, run_id: str, experiment: str | None = None) -> set[str]:
        """Return the keys of the cases of a run (or of one of its experiments) that have a row."""
        wanted = select(_ROWS.case_key).where(_ROWS.run_id == run_id)
        if experiment is not None:
            wanted = wanted.where(_ROWS.experiment == experiment)
        with self.session("read the rows") as session:
            return set(session.execute(wanted).scalars())

    def outcome_counts(self, run_id: str) -> dict[Outcome, int]:
        """Return how many of a run's rows have each outcome; outcomes that none has are left out."""
        counted = select(_ROWS.outcome, func.count()).where(_ROWS.run_id == run_id).group_by(_ROWS.outcome)
        with self.session("count the rows") as session:
            found = {Outcome(outcome): count for outcome, count in session.execute(counted)}
        return {outcome: found[outcome] for outcome in Outcome if outcome in found}

    # Pictures and masks

    def put_artifact(self, content: bytes, suffix: str) -> str:
        """Keep a picture or mask and return its name; see :meth:`ArtifactFolder.put`."""
        return self.artifacts.put(content, suffix)

    def artifact(self, name: str) -> bytes:
        """Return a picture or mask, checked against its name; see :meth:`ArtifactFolder.get`."""
        return self.artifacts.get(name)
