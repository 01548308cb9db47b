"""What pages show of many runs: lists, leaderboards and histories, each by queries that an index answers.

Whole rows with their samples are :meth:`Store.rows`'s business; here are the columns that a list shows, of as few rows
as it shows; a leaderboard's are kept beside the rows (:mod:`shadowbench.store.standings`). Lists of what there is (an
experiment's views, a view's techniques) hop along an index from value to value instead of reading every row.
"""

from __future__ import annotations

import threading
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from sqlalchemy import CTE, Row, RowMapping, Select, String, and_, case, cast, false, func, literal, or_, select
from sqlalchemy.orm import Session

from shadowbench.rows import Outcome, RunStatus
from shadowbench.store.access_models import StoredUpload
from shadowbench.store.derived import QUALITY_COLUMNS, TECHNIQUE_FIELDS, TIME_COLUMNS, VIEW_FIELDS
from shadowbench.store.engine import is_sqlite, store_errors
from shadowbench.store.models import StoredRow, StoredRun, StoredStanding
from shadowbench.store.results import Store

_RUNS = StoredRun.__table__.c
_ROWS = StoredRow.__table__.c
_STANDINGS = StoredStanding.__table__.c

_BRIEF = ("run_id", "title", "experiments", "created_at", "finished_at", "status", "case_count", "machine")


@dataclass(frozen=True)
class RunLine:
    """A run as a list shows it."""

    run_id: str
    title: str
    experiments: list[str]
    created_at: str
    finished_at: str | None
    status: RunStatus
    case_count: int
    machine: str
    code_version: str
    outcomes: dict[Outcome, int]
    token_id: str | None
    """The token that uploaded it; ``None`` for one that was measured here."""


@dataclass(frozen=True)
class RunFilter:
    """Which runs a list shall have; empty for all."""

    experiment: str = ""
    method: str = ""
    machine: str = ""
    code_version: str = ""
    status: str = ""
    search: str = ""
    """Text that stands, in whatever case, in the id, title, experiments, machine or version."""


@dataclass(frozen=True)
class View:
    """What rows must share to be compared: a scene, its light, camera and size."""

    view_key: str
    fields: dict[str, Any]


class Catalogue:
    """Lists of what a store holds."""

    def __init__(self, store: Store) -> None:
        self._store = store
        self._watching: Any = None
        self._lock = threading.Lock()

    def version(self) -> str:
        """Return a text that stays the same exactly while nothing in the database changes."""
        with self._lock, store_errors(self._store.place, "look for changes"):
            if self._watching is not None:
                try:
                    return self._watched()
                except self._store.engine.dialect.loaded_dbapi.Error:  # a server that was started again, say
                    self._let_go()
            watching = self._store.engine.raw_connection()
            if not is_sqlite(self._store.engine):
                watching.driver_connection.autocommit = True  # type: ignore[union-attr]
            watching.detach()
            self._watching = watching
            return self._watched()

    def _watched(self) -> str:
        # asked over one connection, which never writes: SQLite tells it of the others' changes
        question = "PRAGMA data_version" if is_sqlite(self._store.engine) else "SELECT pg_current_snapshot()::text"
        return str(self._watching.cursor().execute(question).fetchone()[0])

    def close(self) -> None:
        """Let go of the connection that watches for changes."""
        with self._lock:
            self._let_go()

    def _let_go(self) -> None:
        if self._watching is not None:
            self._watching.close()
            self._watching = None

    def runs(self, wanted: RunFilter, *, limit: int, after: str = "") -> list[RunLine]:
        """Return runs, newest first, from the one behind ``after`` (a run's id) on."""
        columns = [_RUNS[name] for name in _BRIEF] + [_RUNS.code_version]
        query: Select[Any] = select(*columns, StoredUpload.token_id).outerjoin(
            StoredUpload, StoredUpload.run_id == _RUNS.run_id
        )
        query = _filtered(query, wanted).order_by(_RUNS.created_at.desc(), _RUNS.id.desc()).limit(limit)
        with self._store.session("list the runs") as session:
            if after:
                place = session.execute(select(_RUNS.created_at, _RUNS.id).where(_RUNS.run_id == after)).first()
                if place is None:
                    return []
                same_time = (_RUNS.created_at == place.created_at) & (_RUNS.id < place.id)
                query = query.where(or_(_RUNS.created_at < place.created_at, same_time))
            found = [dict(values) for values in session.execute(query).mappings()]
            counts = _outcomes(session, [values["run_id"] for values in found])
        return [
            RunLine(**(values | {"status": RunStatus(values["status"])}), outcomes=counts.get(values["run_id"], {}))
            for values in found
        ]

    def count_runs(self, wanted: RunFilter) -> int:
        """Return how many runs there are."""
        with self._store.session("count the runs") as session:
            query = _filtered(select(func.count()).select_from(StoredRun.__table__), wanted)
            return int(session.execute(query).scalar_one())

    def state_of(self, run_id: str) -> str:
        """Return a text that another one takes the place of when a run, or a row of it, changes."""
        rows = select(func.count(), func.max(_ROWS.id), func.max(_ROWS.measured_at)).where(_ROWS.run_id == run_id)
        run = select(_RUNS.id, _RUNS.status, _RUNS.finished_at, StoredUpload.digest).outerjoin(
            StoredUpload, StoredUpload.run_id == _RUNS.run_id
        )
        with self._store.session("look for changes") as session:
            known = session.execute(run.where(_RUNS.run_id == run_id)).first()
            return repr((known and tuple(known), tuple(session.execute(rows).one())))

    def facets(self) -> dict[str, list[str]]:
        """Return the machines, versions and experiments of all runs, and the methods of all rows."""
        with self._store.session("list machines and versions") as session:
            machines = session.execute(select(_RUNS.machine).distinct().order_by(_RUNS.machine)).scalars()
            versions = session.execute(select(_RUNS.code_version).distinct().order_by(_RUNS.code_version)).scalars()
            return {
                "machine": list(machines),
                "code_version": list(versions),
                "experiment": _experiments(session),
                "method": _values_along_index(session, _ROWS.method),
            }

    def machines(self) -> list[dict[str, Any]]:
        """Return each machine with its number of runs, its first and last one, and that one's environment."""
        counted = (
            select(
                _RUNS.machine,
                func.count().label("runs"),
                func.min(_RUNS.created_at).label("first"),
                func.max(_RUNS.created_at).label("last"),
            )
            .group_by(_RUNS.machine)
            .order_by(func.max(_RUNS.created_at).desc())
        )
        newest = select(_RUNS.environment, _RUNS.run_id).order_by(_RUNS.created_at.desc(), _RUNS.id.desc()).limit(1)
        with self._store.session("list the machines") as session:
            found = [dict(values) for values in session.execute(counted).mappings()]
            for machine in found:
                run = session.execute(newest.where(_RUNS.machine == machine["machine"])).one()
                machine |= {"environment": run.environment, "last_run": run.run_id}
            return found

    def views(self, experiment: str) -> list[View]:
        """Return the views of an experiment."""
        own = (_STANDINGS.experiment == experiment,)
        with self._store.session("list the views") as session:
            found = [
                View(values["view_key"], {name: values[name] for name in VIEW_FIELDS})
                for values in _rows_along_index(session, _STANDINGS.view_key, own, VIEW_FIELDS)
            ]
        return sorted(found, key=lambda view: [str(value) for value in view.fields.values()])

    def technique_counts(self, experiment: str) -> dict[str, int]:
        """Return how many techniques each view of an experiment has, by the views' keys."""
        count = func.count(_STANDINGS.technique_key.distinct())
        query = select(_STANDINGS.view_key, count).where(_STANDINGS.experiment == experiment)
        with self._store.session("count the techniques") as session:
            return {row.view_key: row[1] for row in session.execute(query.group_by(_STANDINGS.view_key))}

    def quality_standings(self, experiment: str, view_key: str, versions: Sequence[str]) -> list[Row[Any]]:
        """Return the newest measured row of each technique and version in a view, whatever machine it is of.

        Each has :data:`~shadowbench.store.derived.QUALITY_COLUMNS`, on how many ``machines`` the version was measured,
        and whether pixels ``differ`` between them.

        Args:
            experiment: The experiment.
            view_key: The view.
            versions: Which versions' rows.
        """
        own = (*_own(experiment, view_key), _STANDINGS.code_version.in_(versions))
        same = (_STANDINGS.technique_key, _STANDINGS.code_version)
        rank = case((_STANDINGS.outcome == Outcome.OK.value, "1"), else_="0").concat(_STANDINGS.measured_at)
        digest = func.nullif(_STANDINGS.visibility_digest, "")
        best = (
            select(
                *same,
                func.max(rank).label("rank"),
                func.count().label("machines"),
                func.coalesce(func.min(digest) != func.max(digest), false()).label("differs"),
            )
            .where(*own)
            .group_by(*same)
            .subquery()
        )
        is_best = and_(rank == best.c.rank, *(column == best.c[column.name] for column in same))
        columns = (*(_STANDINGS[name] for name in QUALITY_COLUMNS), best.c.machines, best.c.differs)
        query = select(*columns).join(best, is_best).where(*own).order_by(_STANDINGS.row_id.desc())
        with self._store.session("read the leaderboard") as session:
            found = session.execute(query).all()
        return list({(row.technique_key, row.code_version): row for row in found}.values())  # one of the same moment

    def time_standings(self, experiment: str, view_key: str, machine: str, versions: Sequence[str]) -> list[Row[Any]]:
        """Return the newest row of each technique and version in a view, on one machine.

        Each has :data:`~shadowbench.store.derived.TIME_COLUMNS`.

        Args:
            experiment: The experiment.
            view_key: The view.
            machine: Whose rows.
            versions: Which versions' rows.
        """
        query = select(*(_STANDINGS[name] for name in TIME_COLUMNS)).where(*_own(experiment, view_key))
        query = query.where(_STANDINGS.machine == machine, _STANDINGS.code_version.in_(versions))
        with self._store.session("read the leaderboard") as session:
            return list(session.execute(query).all())

    def places(self, experiment: str, view_key: str) -> list[tuple[str, str, str]]:
        """Return the machines and versions that a view was measured on and with, and when last."""
        last = func.max(_STANDINGS.measured_at)
        query = select(_STANDINGS.machine, _STANDINGS.code_version, last).where(*_own(experiment, view_key))
        with self._store.session("list machines and versions") as session:
            found = session.execute(query.group_by(_STANDINGS.code_version, _STANDINGS.machine)).all()
            return [(machine, version, moment) for machine, version, moment in found]

    def techniques(self, experiment: str, view_key: str) -> dict[str, dict[str, Any]]:
        """Return the techniques of a view by their keys: title, and the fields that make one."""
        columns = ("method_title", *TECHNIQUE_FIELDS)
        with self._store.session("list the techniques") as session:
            found = _rows_along_index(session, _STANDINGS.technique_key, _own(experiment, view_key), columns)
            return {values["technique_key"]: {name: values[name] for name in columns} for values in found}

    def history(self, method: str, experiment: str, view_key: str, columns: Sequence[str]) -> list[Row[Any]]:
        """Return every row of a method in a view, oldest first."""
        own = (_ROWS.method == method, _ROWS.experiment == experiment, _ROWS.view_key == view_key)
        query = select(*(_ROWS[name] for name in columns)).where(*own).order_by(_ROWS.measured_at, _ROWS.id)
        with self._store.session("read the history") as session:
            return list(session.execute(query).all())

    def experiments_of(self, method: str) -> list[str]:
        """Return the experiments that a method has rows in."""
        with self._store.session("list the experiments") as session:
            return _values_along_index(session, _ROWS.experiment, _ROWS.method == method)

    def views_of(self, method: str, experiment: str) -> list[View]:
        """Return the views of an experiment that a method has rows in."""
        own = (_ROWS.method == method) & (_ROWS.experiment == experiment)
        with self._store.session("list the views") as session:
            keys = set(_values_along_index(session, _ROWS.view_key, own))
        return [view for view in self.views(experiment) if view.view_key in keys]


def _filtered(query: Select[Any], wanted: RunFilter) -> Select[Any]:
    for name in ("machine", "code_version", "status"):
        if getattr(wanted, name):
            query = query.where(_RUNS[name] == getattr(wanted, name))
    for name in ("experiment", "method"):
        if getattr(wanted, name):
            own = select(literal(1)).where(_ROWS.run_id == _RUNS.run_id, _ROWS[name] == getattr(wanted, name))
            query = query.where(own.exists())
    if wanted.search:
        texts = (_RUNS.run_id, _RUNS.title, cast(_RUNS.experiments, String), _RUNS.machine, _RUNS.code_version)
        query = query.where(or_(*(text.icontains(wanted.search, autoescape=True) for text in texts)))
    return query


def _outcomes(session: Session, run_ids: Sequence[str]) -> dict[str, dict[Outcome, int]]:
    counted = select(_ROWS.run_id, _ROWS.outcome, func.count()).where(_ROWS.run_id.in_(run_ids))
    found: dict[str, dict[Outcome, int]] = {}
    for run_id, outcome, count in session.execute(counted.group_by(_ROWS.run_id, _ROWS.outcome)):
        found.setdefault(run_id, {})[Outcome(outcome)] = count
    return found


def _experiments(session: Session) -> list[str]:
    lists = session.execute(select(_RUNS.experiments)).scalars()
    return sorted({name for names in lists for name in names})


def _own(experiment: str, view_key: str) -> tuple[Any, Any]:
    return (_STANDINGS.experiment == experiment, _STANDINGS.view_key == view_key)


def _values_along_index(session: Session, column: Any, *conditions: Any) -> list[str]:
    """Return the different values of a column, hopping along an index whose next column it is."""
    hop = _hop(column, conditions)
    return list(session.execute(select(hop.c.value).where(hop.c.value.is_not(None))).scalars())


def _rows_along_index(
    session: Session, column: Any, conditions: Sequence[Any], names: Sequence[str]
) -> list[RowMapping]:
    """Return, for each different value of a column of standings, some columns of a row that has it."""
    hop = _hop(column, conditions)
    one = select(_STANDINGS.row_id).where(*conditions, column == hop.c.value).limit(1).scalar_subquery()
    columns = (_ROWS[name] for name in dict.fromkeys((column.name, *names)))
    return list(session.execute(select(*columns).join(hop, _ROWS.id == one)).mappings())


def _hop(column: Any, conditions: Sequence[Any]) -> CTE:
    first = select(func.min(column).label("value")).where(*conditions)
    hop = first.cte("hop", recursive=True)
    following = select(func.min(column)).where(*conditions, column > hop.c.value).scalar_subquery()
    return hop.union_all(select(following).where(hop.c.value.is_not(None)))
