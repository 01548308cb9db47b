"""How many requests a second a results service answers, and how long the slowest hundredth waits.

Fills a store with 200 runs of 500 cases (100,000 rows), starts ``shadowbench serve`` on it, and asks for the list of
runs, a case and a leaderboard from four clients at a time over kept connections; then again while eight clients upload
runs. Every leaderboard is also asked for once after an upload, when nothing made earlier can be used. In the end each
upload is there once and whole. Client and server share this machine's cores; so does PostgreSQL with ``--postgresql``,
which starts a server of its own as the tests do, but one that keeps what it was told.

Usage: python tests/benchmarks/service_load.py [--runs 200] [--seconds 10] [--workers 1] [--database URL | --postgresql]
"""

from __future__ import annotations

import argparse
import contextlib
import datetime as dt
import http.client
import itertools
import json
import multiprocessing
import sys
import tempfile
import threading
import time
from pathlib import Path
from typing import Any

from sqlalchemy import func, insert, literal, select, text

sys.path.insert(0, str(Path(__file__).parent.parent))

import postgresql_server
from service.live import serving
from stored_rows import some_row, some_run

from shadowbench.rows import ResultRow, RunRecord
from shadowbench.store import Store
from shadowbench.store.catalogue import Catalogue
from shadowbench.store.derived import STANDING_KEY
from shadowbench.store.documents import row_document, run_document
from shadowbench.store.engine import is_sqlite
from shadowbench.store.models import LONG_MODELS, StoredRow, StoredRun
from shadowbench.store.standings import settle
from shadowbench.store.tokens import Scope, TokenBook
from shadowbench.store.uploads import Uploader, put_run

VIEWS, TECHNIQUES, MACHINES, RUNS_A_VERSION = 10, 50, 8, 40
READERS, UPLOADERS = 4, 8
FIRST_ANSWERS = 10


def a_run(number: int, row_count: int = VIEWS * TECHNIQUES) -> tuple[RunRecord, list[ResultRow]]:
    """A run of 500 cases: ten views of fifty techniques; or of the first of them."""
    begun = (dt.datetime(2026, 1, 1, tzinfo=dt.UTC) + dt.timedelta(hours=number)).isoformat()
    place = {"machine": f"machine {number % MACHINES}", "code_version": f"0.{number // RUNS_A_VERSION}.0"}
    run = some_run(run_id=f"run-{number:05d}", created_at=begun, case_count=VIEWS * TECHNIQUES, **place)
    rows = [
        some_row(
            f"method-{technique % 10}",
            run_id=run.run_id,
            case_key=f"case-{view}-{technique}",
            scene=f"scene-{view}",
            method_parameters={"resolution": 512 << (technique // 10)},
            measured_at=begun,
            visibility_digest=f"{view}-{technique}",
            rmse=0.01 * technique,
            samples={name: [1.0 + 0.01 * i for i in range(6)] for name in ("build", "shade", "camera")},
            stages={"draw": 1.0, "filter": 0.5},
            counters={"texels": technique * 1000},
            **place,
        )
        for view, technique in itertools.islice(itertools.product(range(VIEWS), range(TECHNIQUES)), row_count)
    ]
    return run, rows


def fill(store: Store, run_count: int) -> None:
    """Keep runs: the first in full, the others as copies of it made inside the database, which is many times faster."""
    put_run(store, *a_run(0), Uploader("load"))
    tables = [StoredRun.__table__, StoredRow.__table__, *(model.__table__ for model in LONG_MODELS.values())]
    cases = VIEWS * TECHNIQUES
    for number in range(1, run_count):
        run, rows = a_run(number, row_count=1)
        with store.session("copy a run", writes=True) as session:
            for table in tables:
                changed: dict[str, Any] = {}
                if table.name == "runs":
                    changed = {name: getattr(run, name) for name in ("created_at", "machine", "code_version", "run_id")}
                    changed |= {"id": table.c.id + number}
                    source = table.c.run_id == "run-00000"
                elif table.name == "rows":
                    changed = {name: getattr(rows[0], name) for name in ("measured_at", "machine", "code_version")}
                    changed |= {"run_id": run.run_id, "id": table.c.id + number * cases}
                    source = table.c.run_id == "run-00000"
                else:
                    changed = {"row_id": table.c.row_id + number * cases}
                    source = table.c.row_id <= cases
                values = [_column(changed, column) for column in table.c]
                session.execute(insert(table).from_select([c.name for c in table.c], select(*values).where(source)))
    with store.session("settle the standings, which copies inside the database do not", writes=True) as session:
        keys = select(*(StoredRow.__table__.c[name] for name in STANDING_KEY)).distinct()
        settle(session, [tuple(key) for key in session.execute(keys)])
    if not is_sqlite(store.engine):
        with store.session("let ids go on after the last one", writes=True) as session:
            for table in tables[:2]:
                sequence = func.pg_get_serial_sequence(table.name, "id")
                session.execute(select(func.setval(sequence, select(func.max(table.c.id)).scalar_subquery())))
            session.execute(text("ANALYZE"))  # which the server does by itself within a minute


def _column(changed: dict[str, Any], column: Any) -> Any:
    value = changed.get(column.name, column)
    return literal(value) if isinstance(value, str) else value


def percentile(values: list[float], share: float) -> float:
    """The value that this share of them does not exceed."""
    ordered = sorted(values)
    return ordered[min(len(ordered) - 1, int(share * len(ordered)))]


def ask(port: int, path: str, seconds: float, times: list[float]) -> None:
    """Ask for a page over one connection for some time."""
    connection = http.client.HTTPConnection("127.0.0.1", port)
    end = time.perf_counter() + seconds
    while time.perf_counter() < end:
        begin = time.perf_counter()
        connection.request("GET", path)
        answer = connection.getresponse()
        answer.read()
        assert answer.status == 200, answer.status
        times.append(time.perf_counter() - begin)
    connection.close()


def measured(port: int, name: str, path: str, seconds: float) -> None:
    """Print requests a second and waits of one page, asked for by several clients."""
    times: list[float] = []
    threads = [threading.Thread(target=ask, args=(port, path, seconds, times)) for _ in range(READERS)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    median, tail, slowest = (1e3 * percentile(times, share) for share in (0.5, 0.99, 1.0))
    waits = f"median {median:7.1f} ms   p99 {tail:7.1f} ms   slowest {slowest:7.1f} ms"
    print(f"{name:34} {len(times) / seconds:8.0f} /s   {waits}", flush=True)


def a_body(number: int) -> str:
    """A run as it is uploaded."""
    run, rows = a_run(number)
    return json.dumps({"run": run_document(run), "rows": [row_document(row) for row in rows]})


def upload(port: int, token: str, run_id: str, body: str) -> str:
    """Upload a run; return its id as the service acknowledges it."""
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=120)
    connection.request("PUT", f"/api/v1/runs/{run_id}", body, {"Authorization": f"Bearer {token}"})
    answer = connection.getresponse()
    assert answer.status == 201, answer.read()
    acknowledged: str = json.loads(answer.read())["run_id"]
    connection.close()
    return acknowledged


def upload_until(stop: Any, port: int, token: str, first: int, kept: Any) -> None:
    """Upload runs one after another, from several threads, until told to stop; report the ids that were acknowledged.

    In a process of its own, and with texts made beforehand: what is measured is the service, not its clients.
    """

    def one_after_another(uploader: int) -> None:
        begin = first + 1000 * uploader
        body = a_body(begin)
        ready.wait()
        for number in range(begin, begin + 1000):
            if stop.is_set():
                break
            run_id = f"run-{number:05d}"
            mine.append(upload(port, token, run_id, body.replace(f"run-{begin:05d}", run_id)))

    mine: list[str] = []
    ready = threading.Barrier(UPLOADERS)
    threads = [threading.Thread(target=one_after_another, args=(uploader,)) for uploader in range(UPLOADERS)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    kept.put(mine)


def first_answers(port: int, token: str, paths: dict[str, str], first: int) -> None:
    """Print how long each page takes right after an upload."""
    found: dict[str, list[float]] = {name: [] for name in paths}
    for number in range(first, first + FIRST_ANSWERS):
        upload(port, token, f"run-{number:05d}", a_body(number))
        for name, path in paths.items():
            ask(port, path, 0.0001, found[name])
    for name, times in found.items():
        print(f"{name + ', first after an upload':34} median {1e3 * percentile(times, 0.5):7.1f} ms", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=200)
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--workers", type=int, default=1)
    where = parser.add_mutually_exclusive_group()
    where.add_argument("--database", metavar="URL", help="of an empty PostgreSQL database")
    where.add_argument("--postgresql", action="store_true", help="start a server")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder, contextlib.ExitStack() as stack:
        if given.postgresql:
            given.database = stack.enter_context(postgresql_server.running(durable=True)).format("postgres")
        results = Path(folder) / "results"
        with Store.open(results, database=given.database) as store:
            begin = time.perf_counter()
            fill(store, given.runs)
            seconds = time.perf_counter() - begin
            view = Catalogue(store).views("quick")[0].view_key
            _, token = TokenBook(store).create("load", Scope.UPLOAD, None)
        print(f"{given.runs} runs, {given.runs * VIEWS * TECHNIQUES} rows, kept in {seconds:.0f} s", flush=True)
        paths = {
            "runs": "/runs",
            "case": "/runs/run-00003/cases/case-0-3",
            "leaderboard": f"/experiments/quick?view={view}",
        }
        options = ["--rate", "0", "--workers", str(given.workers)]
        with serving(results, *options, database=given.database) as live:
            port = int(live.address.rpartition(":")[2])
            first_answers(port, token, paths, given.runs)
            for name, path in paths.items():
                measured(port, name, path, given.seconds)
            apart = multiprocessing.get_context("spawn")
            stop, acknowledged = apart.Event(), apart.Queue()
            uploads = apart.Process(
                target=upload_until, args=(stop, port, token, given.runs + 100, acknowledged), daemon=True
            )
            uploads.start()
            begin = time.perf_counter()
            for name, path in paths.items():
                measured(port, f"{name}, while 8 clients upload", path, given.seconds)
            stop.set()
            kept: list[str] = acknowledged.get()
            print(f"uploads of 500 rows: {len(kept) / (time.perf_counter() - begin):.2f} /s", flush=True)
            uploads.join()
        with Store.open(results, database=given.database) as store:
            runs = [run.run_id for run in store.runs()]
            assert len(runs) == len(set(runs)) == given.runs + FIRST_ANSWERS + len(kept), (
                "an upload was lost or doubled"
            )
            assert all(len(store.finished_case_keys(run_id)) == VIEWS * TECHNIQUES for run_id in kept)
            print(f"{len(kept)} uploads, each there once and whole")


if __name__ == "__main__":
    main()
