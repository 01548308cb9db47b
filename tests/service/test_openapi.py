"""The API's own description, and what happens when everything that it allows, and much that it does not, is tried.

Schemathesis makes the requests; no answer may be a fault of the service.
"""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import HealthCheck, Phase, given, settings

schemathesis = pytest.importorskip("schemathesis")

from shadowbench.service.app import create_app  # noqa: E402
from shadowbench.service.settings import Settings  # noqa: E402
from shadowbench.store import Store  # noqa: E402
from shadowbench.store.tokens import Scope, TokenBook  # noqa: E402
from shadowbench.store.uploads import Uploader, put_run  # noqa: E402

pytestmark = pytest.mark.filterwarnings("ignore")  # schemathesis's own


@pytest.fixture(scope="module")
def described(tmp_path_factory: pytest.TempPathFactory, lasting_database: str | None):
    from stored_rows import some_row, some_run

    results = tmp_path_factory.mktemp("described")
    with Store.open(results, database=lasting_database) as store:
        put_run(store, some_run(run_id="a"), [some_row(run_id="a", case_key="c")], Uploader("t"))
        _, token = TokenBook(store).create("x", Scope.ADMIN, None)
    chosen = Settings(
        results=Path(results),
        database=lasting_database,
        hosts=("*",),
        requests_a_second=0.0,
        wrong_tokens=1_000_000,
    )
    app = create_app(chosen)
    schema = schemathesis.openapi.from_asgi("/api/openapi.json", app)
    schema.token = token
    return schema


@pytest.mark.slow
def test_no_request_is_answered_with_a_fault(described) -> None:
    tried = 0
    for found in described.get_all_operations():
        operation = found.ok()

        @given(case=operation.as_strategy())
        @settings(
            max_examples=25,
            deadline=None,
            derandomize=True,
            database=None,
            phases=(Phase.explicit, Phase.generate),
            suppress_health_check=list(HealthCheck),
        )
        def ask(case) -> None:
            answer = case.call(headers={"Authorization": f"Bearer {described.token}"})
            assert answer.status_code < 500, (case.formatted_path, answer.text)
            if answer.status_code >= 400:
                assert answer.headers["content-type"][0].startswith("application/problem+json")

        ask()
        tried += 1
    assert tried >= 24


def test_the_description_names_every_operation_and_its_problems(described) -> None:
    document = described.raw_schema
    operations = [
        (path, method, operation)
        for path, methods in document["paths"].items()
        for method, operation in methods.items()
    ]
    assert len(operations) >= 24
    for path, method, operation in operations:
        assert operation.get("summary"), (path, method)
        assert operation.get("description"), (path, method)
        if "read" in operation["tags"] or "upload" in operation["tags"]:
            assert "application/problem+json" in operation["responses"]["401"]["content"], path
