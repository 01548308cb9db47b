"""Uploading: pictures first, a run at once and wholly, again without harm; and every refusal with its reason."""

from __future__ import annotations

import gzip
import json
import math
from typing import Any

import pytest
from service.conftest import Maker, Service
from sqlalchemy import text
from stored_rows import png, some_row, some_run, with_pictures

from shadowbench.errors import StorageFullError
from shadowbench.store import Store
from shadowbench.store.documents import row_document, run_document

RUN = some_run(case_count=1)


def body(**changes: Any) -> dict[str, Any]:
    """A run of one case; ``run__`` and ``row__`` name what is changed in it."""
    run, row = run_document(RUN), row_document(some_row(case_key="a"))
    for name, value in changes.items():
        where, _, inner = name.partition("__")
        {"run": run, "row": row}[where][inner] = value
    return {"run": run, "rows": [row]}


def test_a_run_is_kept_as_it_was_sent_and_counts_once(service: Service) -> None:
    rows = [some_row(stages={"map": math.nan}, samples={"build": [1.0, math.nan]}, counters={"nodes": 2**62})]
    first = service.put(RUN, rows)
    assert first.status_code == 201
    assert first.json()["kept"] == "created"
    again = service.put(RUN, rows)
    assert (again.status_code, again.json()["kept"]) == (200, "unchanged")
    assert again.json()["digest"] == first.json()["digest"]
    assert service.store.runs() == [RUN]
    assert [r.model_dump_json() for r in service.store.rows(RUN.run_id)] == [r.model_dump_json() for r in rows]


def test_a_run_is_replaced_by_its_own_token_and_by_an_admin_only(service: Service) -> None:
    assert service.put(RUN, [some_row("pcf")]).status_code == 201
    assert service.put(RUN, [some_row("esm")]).json()["kept"] == "replaced"
    service.tokens["first"] = service.tokens.pop("upload")
    other = service.put(RUN, [some_row("vsm")])
    assert other.status_code == 409
    assert "another token" in other.json()["detail"]
    assert service.put(RUN, [some_row("vsm")], "admin").json()["kept"] == "replaced"


def test_only_missing_pictures_travel_and_a_run_waits_for_them(service: Service, tmp_path: Any) -> None:
    with Store.open(tmp_path / "elsewhere") as elsewhere:
        row = with_pictures(elsewhere, some_row())
        contents = {name: elsewhere.artifact(name) for name in row.artifacts.values()}
    early = service.put(RUN, [row])
    assert early.status_code == 409
    assert set(early.json()["missing"]) == set(contents)
    names = list(contents)
    assert service.put_picture(contents[names[0]]).status_code == 201
    assert service.put_picture(contents[names[0]]).status_code == 200
    asked = service.client.post("/api/v1/artifacts/missing", json={"names": names}, headers=service.as_())
    assert asked.json() == {"missing": names[1:]}
    for content in list(contents.values())[1:]:
        service.put_picture(content)
    assert service.put(RUN, [row]).status_code == 201
    assert service.store.artifact(names[1]) == contents[names[1]]


@pytest.mark.parametrize(
    ("changes", "place"),
    [
        ({"row__threads": "many"}, "rows[0].threads"),
        ({"row__failure_percent": 2**70}, "rows[0].failure_percent"),
        ({"row__run_id": "other"}, "rows[0].run_id"),
        ({"row__surprise": 1}, "rows[0].surprise"),
        ({"row__outcome": "levitated"}, "rows[0].outcome"),
        ({"row__artifacts": {"result": "../../etc/passwd"}}, "rows[0].artifacts['result']"),
        ({"row__scene": "s" * 301}, "rows[0].scene"),
        ({"row__method_parameters": {"a": [[[[[[[[[[[[[[[[[[1]]]]]]]]]]]]]]]]]]}}, None),
        ({"run__run_id": "../x"}, "run.run_id"),
        ({"run__case_count": 2}, "rows"),
        ({"run__case_count": -1}, "run.case_count"),
        ({"run__finished_at": None}, "run.finished_at"),
        ({"run__argv": "not a list"}, "run.argv"),
    ],
)
def test_a_fault_is_answered_with_its_place(service: Service, changes: dict[str, Any], place: str | None) -> None:
    answer = service.put_body(RUN.run_id, body(**changes))
    assert answer.status_code == 422, answer.text
    assert answer.headers["content-type"] == "application/problem+json"
    problem = answer.json()
    assert problem["status"] == 422
    if place is not None:
        assert problem["place"] == place
    assert service.store.runs() == []


@pytest.mark.parametrize("number", ["NaN", "Infinity", "-Infinity", "1e999", "-1e999"])
def test_numbers_that_are_none_are_refused(service: Service, number: str) -> None:
    sent = json.dumps(body(row__rmse=12345.5)).replace("12345.5", number)
    answer = service.put_body(RUN.run_id, sent)
    assert answer.status_code == 422
    assert service.store.runs() == []


def test_a_run_under_another_id_is_refused(service: Service) -> None:
    answer = service.put_body("another", body())
    assert (answer.status_code, answer.json()["place"]) == (422, "run.run_id")


def test_the_same_case_twice_is_refused(service: Service) -> None:
    twice = body()
    twice["rows"] *= 2
    answer = service.put_body(RUN.run_id, twice)
    assert (answer.status_code, answer.json()["place"]) == (422, "rows[1].case_key")


def test_bodies_that_are_too_large_packed_or_plain_are_refused(make_service: Maker) -> None:
    service = make_service(largest_body=100_000)
    plain = service.put_body(RUN.run_id, b" " * 200_000)
    assert plain.status_code == 413
    bomb = gzip.compress(b" " * 50_000_000)
    assert len(bomb) < 100_000
    headers = service.as_() | {"Content-Encoding": "gzip"}
    packed = service.client.put(f"/api/v1/runs/{RUN.run_id}", content=bomb, headers=headers)
    assert packed.status_code == 413

    def chunks() -> Any:  # without Content-Length
        for _ in range(50):
            yield b" " * 10_000

    streamed = service.client.put(f"/api/v1/runs/{RUN.run_id}", content=chunks(), headers=service.as_())
    assert streamed.status_code == 413


@pytest.mark.parametrize(
    ("content", "encoding", "status"),
    [
        (b"not gzip", "gzip", 400),
        (gzip.compress(b"{}", mtime=0)[:-6], "gzip", 400),
        (gzip.compress(b"{}", mtime=0) + b"more", "gzip", 400),
        (b"{}", "br", 415),
        (b"", "identity", 422),
        (b"[]", "identity", 422),
        (b"[" * 100_000, "identity", 422),
        (b'{"run": 1}', "identity", 422),
        (b"\xff\xfe", "identity", 422),
    ],
)
def test_damaged_bodies_are_refused(service: Service, content: bytes, encoding: str, status: int) -> None:
    headers = service.as_() | {"Content-Encoding": encoding}
    answer = service.client.put(f"/api/v1/runs/{RUN.run_id}", content=content, headers=headers)
    assert answer.status_code == status
    assert answer.headers["content-type"] == "application/problem+json"


def test_a_full_disk_is_507_and_leaves_everything_as_it_was(service: Service, monkeypatch: pytest.MonkeyPatch) -> None:
    import os

    assert service.put(RUN, [some_row("pcf")]).status_code == 201

    def full(_: int) -> None:
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patched:
        patched.setattr(os, "fsync", full)
        answer = service.put_picture()
    assert answer.status_code == 507
    assert str(service.settings.results) not in answer.text
    assert not [path for path in service.store.folder.rglob("*.png*") if path.is_file()]

    from shadowbench.store import uploads

    def no_room(*_: Any) -> None:
        raise StorageFullError("disk full")

    with monkeypatch.context() as patched:
        patched.setattr(uploads, "insert_rows", no_room)
        answer = service.put(some_run(run_id="second"), [some_row(run_id="second")])
    assert answer.status_code == 507
    assert [run.run_id for run in service.store.runs()] == [RUN.run_id]
    assert service.put(some_run(run_id="second"), [some_row(run_id="second")]).status_code == 201


def test_every_upload_is_in_the_audit_trail_with_token_and_address(service: Service) -> None:
    service.put(RUN, [some_row()])
    service.put_picture()
    with service.store.engine.connect() as connection:
        lines = connection.execute(text("SELECT action, subject, token_id, address FROM audit ORDER BY id")).all()
    actions = [line[0] for line in lines]
    assert actions == ["token created", "run created", "picture created"]
    assert lines[1][1] == RUN.run_id
    assert all(line[2] and line[3] for line in lines[1:])
    assert len({line[2] for line in lines[1:]}) == 1


def test_what_was_refused_before_its_line_was_written_has_one_when_sent_again(
    service: Service, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    from shadowbench.store import uploads

    def no_room(*_: Any) -> None:
        raise StorageFullError("disk full")

    row = some_row()
    caplog.set_level("INFO", "shadowbench.service")
    with monkeypatch.context() as patched:
        patched.setattr(uploads, "add_to_audit", no_room)
        assert service.put_picture().status_code == 507
        assert service.put(RUN, [row]).status_code == 507
    assert sum("disk full" in record.getMessage() for record in caplog.records) == 2
    requests = [record for record in caplog.records if record.getMessage() == "request"]
    assert [(said["method"], said["status"]) for said in (vars(record)["said"] for record in requests)] == [
        ("PUT", 507)
    ] * 2
    assert service.store.runs() == []
    for _ in range(2):  # the second time changes nothing
        picture, run = service.put_picture(), service.put(RUN, [row])
        assert {picture.status_code, run.status_code} <= {200, 201}
    with service.store.engine.connect() as connection:
        subjects = list(connection.execute(text("SELECT subject FROM audit ORDER BY id")).scalars())
    assert subjects[1:] == [picture.json()["name"], RUN.run_id]


def test_pictures_are_served_as_encoded_here(service: Service) -> None:
    import io

    import numpy as np
    from PIL import Image, PngImagePlugin

    texts = PngImagePlugin.PngInfo()
    texts.add_text("Comment", "<script>alert(1)</script>")
    file = io.BytesIO()
    Image.open(io.BytesIO(png(3))).save(file, format="PNG", pnginfo=texts)
    sent = file.getvalue() + b"<html><script>alert(2)</script></html>"
    name = service.put_picture(sent).json()["name"]
    answer = service.client.get(f"/artifacts/{name}")
    assert answer.headers["content-type"] == "image/png"
    assert answer.headers["x-content-type-options"] == "nosniff"
    assert b"script" not in answer.content
    found = np.asarray(Image.open(io.BytesIO(answer.content)))
    assert np.array_equal(found, np.asarray(Image.open(io.BytesIO(png(3)))))
    again = service.client.get(f"/artifacts/{name}", headers={"If-None-Match": answer.headers["etag"]})
    assert again.status_code == 304
