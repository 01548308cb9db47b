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
            max_examples=15,
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


def faults(document, schema, value) -> list[str]:
    """What is wrong with a value by a schema of the description."""
    jsonschema = pytest.importorskip("jsonschema_rs")
    whole = schema | {"components": document["components"]}
    return [f"{error.instance_path}: {error.message}" for error in jsonschema.validator_for(whole).iter_errors(value)]


def answer_schema(document, path: str, method: str = "get", status: str = "200"):
    return document["paths"][path][method]["responses"][status]["content"]["application/json"]["schema"]


def test_the_body_of_an_upload_is_described_field_by_field(described) -> None:
    from stored_rows import some_row, some_run

    from shadowbench.rows import ResultRow, RunRecord
    from shadowbench.store.documents import row_document, run_document

    document = described.raw_schema
    schema = document["paths"]["/api/v1/runs/{run_id}"]["put"]["requestBody"]["content"]["application/json"]["schema"]
    parts = document["components"]["schemas"]
    assert set(parts["Row"]["properties"]) == set(ResultRow.model_fields)
    assert set(parts["EndedRun"]["properties"]) == set(RunRecord.model_fields)
    for name, field in ResultRow.model_fields.items():
        assert parts["Row"]["properties"][name].get("description", "") == (field.description or "")
    odd = some_row(stages={"a": float("nan")}, samples={"build": [1.0, float("nan")]}, outcome="crash")
    body = {"run": run_document(some_run()), "rows": [row_document(some_row()), row_document(odd)]}
    assert faults(document, schema, body) == []
    for wrong in (
        {"rows": body["rows"]},
        body | {"more": 1},
        body | {"run": body["run"] | {"finished_at": None}},
        body | {"run": body["run"] | {"run_id": "../x"}},
        body | {"rows": [body["rows"][0] | {"threads": "many"}]},
        body | {"rows": [body["rows"][0] | {"surprise": 1}]},
        body | {"rows": [body["rows"][0] | {"artifacts": {"result": "../x"}}]},
    ):
        assert faults(document, schema, wrong)


def test_answers_are_what_the_description_says(filled) -> None:
    import hashlib

    from stored_rows import png, some_row, some_run

    document = filled.client.get("/api/openapi.json").json()
    asked = {
        "/api/v1/runs": "/api/v1/runs?limit=2",
        "/api/v1/runs/{run_id}": "/api/v1/runs/run-1",
        "/api/v1/runs/{run_id}/claims": "/api/v1/runs/run-1/claims",
        "/api/v1/runs/{run_id}/cases/{case_key}": "/api/v1/runs/run-1/cases/pcf-1",
        "/api/v1/experiments": "/api/v1/experiments",
        "/api/v1/methods": "/api/v1/methods",
        "/api/v1/machines": "/api/v1/machines",
        "/healthz": "/healthz",
    }
    for path, address in asked.items():
        schema = answer_schema(document, path)
        assert "$ref" in schema
        answer = filled.client.get(address)
        assert answer.status_code == 200
        assert faults(document, schema, answer.json()) == [], path
    name = hashlib.sha256(png(1)).hexdigest() + ".png"
    missing = filled.client.post("/api/v1/artifacts/missing", json={"names": [name]}, headers=filled.as_())
    assert missing.json() == {"missing": [name]}
    found = {
        ("/api/v1/artifacts/missing", "post"): missing,
        ("/api/v1/artifacts/{name}", "put"): filled.put_picture(),
        ("/api/v1/runs/{run_id}", "put"): filled.put(some_run(run_id="more"), [some_row(run_id="more")]),
    }
    for (path, method), answer in found.items():
        schema = answer_schema(document, path, method, str(answer.status_code))
        assert faults(document, schema, answer.json()) == [], path


def test_leaderboards_histories_and_comparisons_are_what_the_description_says(service) -> None:
    from stored_rows import some_row, some_run

    samples = {"build": [1.0, 1.1, 0.9] * 4, "shade": [1.5, 1.6, 1.4] * 4}
    for number in range(3):
        slower = {name: [time * (1 + number) for time in times] for name, times in samples.items()}
        own = {"run_id": f"run-{number}", "machine": "alpha", "code_version": f"1.{number}"}
        measured = own | {"samples": slower, "counters": {"texels": 10 + number}, "kept": {"map": 100 + number}}
        rows = [
            some_row("pcf", **measured, failure_count=number, visibility_digest=f"{number}", rounds=12),
            some_row("esm", **own, outcome="skipped", reason="no kernel"),
            some_row(f"only-{number}", **own, failure_percent=None, dynamic_frame_ms=None),
        ]
        assert service.put(some_run(**own, created_at=f"2026-01-0{number + 1}T00:00:00+00:00"), rows).status_code == 201
    document = service.client.get("/api/openapi.json").json()
    asked = {
        "/api/v1/experiments/{experiment}/leaderboard": ["/api/v1/experiments/quick/leaderboard"],
        "/api/v1/methods/{method}/history": [
            f"/api/v1/methods/{method}/history?measure={measure}"
            for method, measure in (("pcf", "build_ms"), ("pcf", "rmse"), ("esm", "build_ms"), ("only-1", "bytes_kept"))
        ],
        "/api/v1/compare": [f"/api/v1/compare?a=run-{a}&b=run-{b}" for a, b in ((0, 2), (2, 0), (1, 1))],
    }
    found = {}
    for path, addresses in asked.items():
        schema = answer_schema(document, path)
        for address in addresses:
            found[address] = service.client.get(address).json()
            assert faults(document, schema, found[address]) == [], address
            for name in found[address]:
                left_out = {key: value for key, value in found[address].items() if key != name}
                assert faults(document, schema, left_out), (address, name)
            assert faults(document, schema, found[address] | {"more": 1})
    compared = {case["method"]: case for case in found["/api/v1/compare?a=run-0&b=run-2"]["cases"]}
    assert all(compared["pcf"][name] for name in ("counts", "counters", "memory", "times", "changed"))
    assert compared["only-0"]["case_key_b"] is None


def test_no_answer_is_described_as_any_object(described) -> None:
    document = described.raw_schema
    for path, methods in document["paths"].items():
        for method, operation in methods.items():
            for status, answer in operation["responses"].items():
                said = answer.get("content", {}).get("application/json")
                assert said is None or "$ref" in said["schema"], (path, method, status)
    for name, model in document["components"]["schemas"].items():
        assert model.get("properties") or model.get("enum"), name


def test_leaderboards_and_comparisons_have_the_meanings_units_and_words_of_what_they_show(described) -> None:
    from shadowbench.rows import ResultRow, column_unit
    from shadowbench.statistics import Verdict

    parts = described.raw_schema["components"]["schemas"]
    assert set(parts["ComparedTime"]["properties"]["verdict"]["enum"]) == set(Verdict)
    for name, own in (parts["VersionQuality"]["properties"] | parts["VersionTimes"]["properties"]).items():
        if name in ResultRow.model_fields:
            assert own.get("description", "") == (ResultRow.model_fields[name].description or "")
            assert own.get("unit", "") == column_unit(name)
