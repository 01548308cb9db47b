"""The process: where it listens, how it ends, and what is left when it is killed."""

from __future__ import annotations

import http.client
import json
import os
import random
import signal
import threading
from pathlib import Path
from typing import Any

import pytest
from service.live import free_port, serving, start
from stored_rows import some_row, some_run

from shadowbench.cli import main
from shadowbench.service.settings import is_public
from shadowbench.store import Store
from shadowbench.store.documents import row_document, run_document
from shadowbench.store.tokens import Scope, TokenBook
from shadowbench.store.uploads import digest_of

KILLS = int(os.environ.get("SHADOWBENCH_KILLS", "3"))


@pytest.fixture
def token(tmp_path: Path, database: str | None) -> str:
    with Store.open(tmp_path / "results", database=database) as store:
        return TokenBook(store).create("lab", Scope.UPLOAD, None)[1]


def upload(port: int, number: int, token: str, rows: int = 30) -> tuple[int, Any]:
    """Upload a run over a connection of its own; (0, None) if that broke off."""
    run = some_run(run_id=f"run-{number}", case_count=rows)
    measured = [
        some_row(f"m{i}", run_id=run.run_id, case_key=f"{number}-{i}", samples={"build": [1.0] * 20})
        for i in range(rows)
    ]
    body = json.dumps({"run": run_document(run), "rows": [row_document(row) for row in measured]})
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=60)
    try:
        headers = {"Authorization": f"Bearer {token}"}
        connection.request("PUT", f"/api/v1/runs/{run.run_id}", body, headers)
        answer = connection.getresponse()
        return answer.status, json.loads(answer.read())
    except (OSError, http.client.HTTPException):
        return 0, None
    finally:
        connection.close()


def test_a_public_address_needs_a_token(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    where = ["--results", str(tmp_path / "results")]
    assert main(["serve", "--host", "0.0.0.0", *where]) == 2
    assert "make one first" in capfd.readouterr().err
    assert main(["serve", "--host", "example.org", *where]) == 2
    assert "is not an IP address" in capfd.readouterr().err
    assert main(["token", "create", "--name", "r", "--scope", "read", *where]) == 0
    assert main(["serve", "--host", "::", *where]) == 2
    assert [is_public(host) for host in ("127.0.0.1", "::1", "localhost", "0.0.0.0", "::", "10.0.0.1")] == [
        *[False] * 3,
        *[True] * 3,
    ]


def test_it_ends_when_asked_and_its_log_is_json(tmp_path: Path, token: str, database: str | None) -> None:
    with serving(tmp_path / "results", database=database) as live:
        port = int(live.address.rpartition(":")[2])
        assert upload(port, 1, token)[0] == 201
    assert live.process.returncode in (0, -signal.SIGTERM)
    lines = [json.loads(line) for line in live.log.read_text().splitlines()]
    (seen,) = (line for line in lines if line.get("method") == "PUT")
    assert (seen["path"], seen["status"]) == ("/api/v1/runs/run-1", 201)
    with Store.open(tmp_path / "results", database=database) as store:
        assert len(store.rows("run-1")) == 30


@pytest.mark.slow
@pytest.mark.parametrize("database", ["postgresql"], indirect=True)
def test_several_workers_share_the_store_and_their_counters(tmp_path: Path, token: str, database: str | None) -> None:
    import urllib.request

    with serving(tmp_path / "results", "--workers", "2", "--rate", "0", database=database) as live:
        port = int(live.address.rpartition(":")[2])
        threads = [threading.Thread(target=upload, args=(port, number, token)) for number in range(6)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        with urllib.request.urlopen(f"{live.address}/runs.json") as answer:
            assert json.load(answer)["total"] == 6
        with urllib.request.urlopen(f"{live.address}/metrics") as answer:
            assert 'shadowbench_uploads_total{kept="created"} 6.0' in answer.read().decode()


@pytest.mark.slow
def test_every_acknowledged_upload_is_whole_however_often_the_service_is_killed(
    tmp_path: Path, token: str, database: str | None
) -> None:
    """The service is killed with SIGKILL at random moments while four clients upload: by turns at any time, also before
    it has kept anything, and after it has."""
    generator = random.Random(20)
    results, port = tmp_path / "results", free_port()
    acknowledged: dict[str, str] = {}
    numbers = iter(range(1_000_000))
    lock = threading.Lock()

    def work(stop: threading.Event, first: threading.Event) -> None:
        while not stop.is_set():
            with lock:
                number = next(numbers)
            status, answer = upload(port, number, token)
            if status in (200, 201):
                with lock:
                    acknowledged[answer["run_id"]] = answer["digest"]
                first.set()
            elif status == 0:
                return

    for life in range(KILLS):
        live = start(results, "--rate", "0", port=port, database=database)
        stop, first = threading.Event(), threading.Event()
        workers = [threading.Thread(target=work, args=(stop, first)) for _ in range(4)]
        for worker in workers:
            worker.start()
        if life % 2 == 0:
            assert first.wait(timeout=60)
        stop.wait(generator.uniform(0.05, 1.0))
        live.process.kill()
        live.process.wait()
        stop.set()
        for worker in workers:
            worker.join()
    assert len(acknowledged) >= KILLS // 2
    with serving(results, database=database), Store.open(results, database=database) as store:
        runs = {run.run_id: run for run in store.runs()}
        assert set(acknowledged) <= set(runs)
        for run in runs.values():
            rows = store.rows(run.run_id)
            assert len(rows) == 30
            assert acknowledged.get(run.run_id, digest_of(run, rows)) == digest_of(run, rows)
