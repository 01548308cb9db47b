"""A service over a store in a temporary folder, asked without a network, on SQLite and on PostgreSQL."""

from __future__ import annotations

import gzip
import json
import shutil
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient
from stored_rows import png, some_row, some_run

from shadowbench.rows import ResultRow, RunRecord
from shadowbench.service.app import create_app
from shadowbench.service.settings import Settings
from shadowbench.store import Store
from shadowbench.store.documents import row_document, run_document
from shadowbench.store.tokens import Scope, TokenBook


@dataclass
class Service:
    """A running service, its store, and tokens for it."""

    client: TestClient
    store: Store
    settings: Settings
    tokens: dict[str, str] = field(default_factory=dict)

    def as_(self, scope: str = "upload") -> dict[str, str]:
        """Headers with a token of this scope."""
        if scope not in self.tokens:
            _, self.tokens[scope] = TokenBook(self.store).create(scope, Scope(scope), None)
        return {"Authorization": f"Bearer {self.tokens[scope]}"}

    def put(self, run: RunRecord, rows: list[ResultRow], scope: str = "upload", **headers: str) -> Any:
        """Upload a run as a client would."""
        body = json.dumps({"run": run_document(run), "rows": [row_document(row) for row in rows]}).encode()
        sent = self.as_(scope) | {"Content-Encoding": "gzip"} | headers
        return self.client.put(f"/api/v1/runs/{run.run_id}", content=gzip.compress(body), headers=sent)

    def put_body(self, run_id: str, body: bytes | str | dict[str, Any]) -> Any:
        """Upload whatever it is as a run."""
        content = json.dumps(body) if isinstance(body, dict) else body
        return self.client.put(f"/api/v1/runs/{run_id}", content=content, headers=self.as_())

    def put_picture(self, content: bytes | None = None, name: str = "") -> Any:
        """Upload a picture under the name that it must have, or another."""
        import hashlib

        content = png(1) if content is None else content
        name = name or f"{hashlib.sha256(content).hexdigest()}.png"
        return self.client.put(f"/api/v1/artifacts/{name}", content=content, headers=self.as_())


Maker = Callable[..., Service]


@pytest.fixture
def make_service(tmp_path: Path, database: str | None, made_database: Path) -> Iterator[Maker]:
    """Return a function that starts a service with some settings."""
    started: list[Service] = []
    (tmp_path / "results").mkdir(exist_ok=True)
    if database is None:
        shutil.copy(made_database, tmp_path / "results" / made_database.name)

    def make(**given: Any) -> Service:
        settings = Settings(
            results=tmp_path / "results",
            database=database,
            **({"hosts": ("testserver",), "requests_a_second": 0.0} | given),
        )
        client = TestClient(create_app(settings), raise_server_exceptions=False, follow_redirects=False)
        client.__enter__()
        started.append(Service(client, Store.open(settings.results, database=database), settings))
        return started[-1]

    yield make
    for service in started:
        service.store.close()
        service.client.__exit__(None, None, None)


@pytest.fixture
def service(make_service: Maker) -> Service:
    """A service that anybody may read from."""
    return make_service()


@pytest.fixture
def filled(service: Service) -> Service:
    """A service with three runs on two machines, in two versions."""
    for number, (machine, version) in enumerate((("alpha", "1.0"), ("beta", "1.0"), ("alpha", "1.1"))):
        run = some_run(
            run_id=f"run-{number}",
            title=f"Run <{number}>",
            machine=machine,
            code_version=version,
            created_at=f"2026-01-0{number + 1}T00:00:00+00:00",
            case_count=2,
        )
        common = {
            "run_id": run.run_id,
            "machine": machine,
            "code_version": version,
            "measured_at": run.created_at,
            "visibility_digest": "same",
        }
        rows = [
            some_row("pcf", **common, case_key=f"pcf-{number}", failure_percent=1.0 + number),
            some_row("esm", **common, case_key=f"esm-{number}", failure_percent=0.5),
        ]
        assert service.put(run, rows).status_code == 201
    return service
