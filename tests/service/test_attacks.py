"""What strangers try: each attack is refused, harmless, or both."""

from __future__ import annotations

import base64
import hashlib
import io
import struct
import zlib
from typing import Any

import pytest
from PIL import Image
from service.conftest import Maker, Service
from stored_rows import png, some_row, some_run

from shadowbench.store.tokens import Scope, TokenBook

NASTY = "<script>alert('x')</script>\"'; DROP TABLE rows; -- {{ 7*7 }} ${7*7} =1+1"


def png_with(width: int, height: int, data: bytes = b"") -> bytes:
    """A PNG file that says it has this size, whatever its pixels are."""

    def chunk(kind: bytes, content: bytes) -> bytes:
        return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))

    header = struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", data) + chunk(b"IEND", b"")


@pytest.mark.parametrize(
    "name",
    [
        "../../../etc/passwd",
        "..%2f..%2f..%2fetc%2fpasswd",
        "%2e%2e/%2e%2e/results.sqlite",
        "..\\..\\results.sqlite",
        "results.sqlite",
        "a" * 64,
        "a" * 64 + ".png/../../results.sqlite",
        "a" * 63 + "/.png",
        "\x00.png",
        "A" * 64 + ".png",
    ],
)
def test_names_do_not_lead_out_of_the_folder(service: Service, name: str) -> None:
    from urllib.parse import quote

    before = sorted(service.store.folder.rglob("*"))
    for path in (name, quote(name, safe="")) if name.isprintable() else (quote(name, safe=""),):
        for prefix in ("/artifacts/", "/api/v1/artifacts/", "/runs/", "/api/docs/"):
            got = service.client.get(prefix + path)
            assert got.status_code in (303, 307, 400, 404, 405, 422), (prefix, path, got.status_code)
            assert b"root:" not in got.content
            assert b"SQLite format" not in got.content
        put = service.client.put(f"/api/v1/artifacts/{path}", content=png(1), headers=service.as_())
        assert put.status_code in (400, 404, 405, 422)
    assert [p for p in sorted(service.store.folder.rglob("*")) if "results.sqlite" not in p.name] == [
        p for p in before if "results.sqlite" not in p.name
    ]


@pytest.mark.parametrize(
    "content",
    [
        png_with(100_000, 100_000),
        png_with(2**31 - 1, 1),
        png_with(0, 0),
        png_with(6000, 6000, zlib.compress(b"\0" * 36_006_000)),
        png_with(64, 64, zlib.compress(b"\0" * 10)),
        png_with(64, 64, b"not zlib"),
        b"\x89PNG\r\n\x1a\n",
        b"GIF89a" + b"\0" * 100,
        b"<svg xmlns='http://www.w3.org/2000/svg'><script>alert(1)</script></svg>",
        b"<!DOCTYPE html><script>alert(1)</script>",
        b"",
    ],
    ids=["huge", "wide", "empty", "bomb", "short", "no-zlib", "cut", "gif", "svg", "html", "nothing"],
)
def test_what_is_no_picture_or_a_bomb_is_refused(service: Service, content: bytes) -> None:
    answer = service.put_picture(content)
    assert answer.status_code == 422
    assert answer.json()["place"] == "body"
    assert not list(service.store.folder.rglob("*.png"))


def test_an_animated_picture_is_refused(service: Service) -> None:
    frames = [Image.open(io.BytesIO(png(seed))).convert("RGB") for seed in (1, 2)]
    file = io.BytesIO()
    frames[0].save(file, format="PNG", save_all=True, append_images=frames[1:])
    assert service.put_picture(file.getvalue()).status_code == 422


def test_a_picture_under_the_name_of_another_is_refused(service: Service) -> None:
    assert service.put_picture(png(1), f"{'a' * 64}.png").status_code == 422


def test_a_picture_with_the_suffix_of_a_page_is_refused(service: Service) -> None:
    name = f"{hashlib.sha256(png(1)).hexdigest()}.html"
    assert service.put_picture(png(1), name).status_code == 422


def test_a_picture_that_is_too_large_is_refused(make_service: Maker) -> None:
    service = make_service(largest_picture=100)
    assert service.put_picture(png(1)).status_code == 413


def test_markup_in_any_text_is_shown_and_does_nothing(service: Service) -> None:
    run = some_run(
        run_id="nasty",
        title=NASTY,
        experiments=[NASTY],
        machine=NASTY,
        code_version=NASTY,
        argv=[NASTY],
        environment={NASTY: NASTY},
        definitions=[{"name": NASTY, "title": NASTY}],
    )
    row = some_row(
        NASTY,
        run_id="nasty",
        experiment=NASTY,
        case_key=NASTY,
        scene=NASTY,
        light=NASTY,
        camera=NASTY,
        machine=NASTY,
        code_version=NASTY,
        warnings=[NASTY],
        stages={NASTY: 1.0},
        counters={NASTY: 1},
        kept={NASTY: 1},
        method_parameters={NASTY: NASTY},
        scene_parameters={NASTY: NASTY},
        reason=NASTY,
        stderr_tail=NASTY,
    )
    assert service.put(run, [row]).status_code == 201
    from urllib.parse import quote

    name = quote(NASTY, safe="")
    pages = ("/runs", "/runs/nasty", f"/runs/nasty/cases/{name}", "/experiments", f"/experiments/{name}", "/methods")
    for path in (*pages, f"/methods/{name}", "/machines", "/compare?a=nasty&b=nasty", f"/runs?q={name}"):
        answer = service.client.get(path, headers={"Accept": "text/html"})
        assert answer.status_code == 200, path
        assert "<script>alert" not in answer.text, path
        assert "{{ 7*7 }}" in answer.text or "7*7" not in answer.text, path
        assert "49" not in answer.text.partition("<h1>")[2].partition("</h1>")[0], path
        policy = answer.headers["content-security-policy"]
        assert "default-src 'none'" in policy
        assert "unsafe-inline" not in policy
        csv = service.client.get(path.replace("?", ".csv?", 1) if "?" in path else path + ".csv")
        assert csv.status_code == 200, path
        for line in csv.text.splitlines():
            for cell in line.split(","):
                assert not cell.strip('"').startswith(("=", "+", "@"))
    report = service.client.get("/runs/nasty/report")
    assert "<script>alert" not in report.text
    assert "frame-ancestors 'none'" in report.headers["content-security-policy"]
    assert [found.run_id for found in service.store.runs()] == ["nasty"]


def test_formulas_are_harmless_in_csv(service: Service) -> None:
    formula = '=HYPERLINK("http://evil")'
    run = some_run(run_id="csv", title=formula, machine="@SUM(A1)", code_version="+1", experiments=["-1+1"])
    service.put(run, [some_row("pcf", run_id="csv", experiment="-1+1", reason="\t=1+1", outcome="error")])
    for path in ("/runs.csv", "/runs/csv.csv", "/experiments.csv", "/machines.csv"):
        import csv

        for line in csv.reader(io.StringIO(service.client.get(path).text)):
            for cell in line:
                assert not cell.startswith(("=", "+", "@", "\t", "\r"))
                assert not (cell.startswith("-") and not cell[1:2].isdigit())


@pytest.mark.parametrize("text", [NASTY, "%", "_", "\\", "' OR '1'='1", "a" * 300, "🦆"])
def test_search_takes_any_text_literally(filled: Service, text: str) -> None:
    for name in ("q", "experiment", "machine", "method", "code_version", "status", "after"):
        answer = filled.client.get("/runs.json", params={name: text})
        assert answer.status_code == 200
        assert answer.json()["runs"] == []


def test_wrong_scopes_and_missing_tokens_are_refused(make_service: Maker) -> None:
    service = make_service(open_reading=False)
    run, row = some_run(), some_row()
    assert service.client.get("/runs.json").status_code == 401
    assert service.client.get("/artifacts/" + "a" * 64 + ".png").status_code == 401
    assert service.client.get("/metrics").status_code == 401
    assert service.client.get("/healthz").status_code == 200
    assert service.client.get("/runs.json", headers=service.as_("read")).status_code == 200
    refused = service.put(run, [row], "read")
    assert refused.status_code == 403
    assert "'read'" in refused.json()["detail"]
    nobody = service.client.put(f"/api/v1/runs/{run.run_id}", content=b"{}")
    assert nobody.status_code == 401
    assert nobody.headers["www-authenticate"].startswith("Bearer")
    assert service.store.runs() == []


def test_a_browsers_password_reads_and_never_writes(make_service: Maker) -> None:
    service = make_service(open_reading=False)
    token = service.as_("upload")["Authorization"].removeprefix("Bearer ")
    basic = {"Authorization": "Basic " + base64.b64encode(f"anyone:{token}".encode()).decode()}
    asked = service.client.get("/runs", headers={"Accept": "text/html"})
    assert asked.headers["www-authenticate"].startswith("Basic")
    assert service.client.get("/runs", headers=basic).status_code == 200
    assert service.client.put("/api/v1/runs/x", content=b"{}", headers=basic).status_code == 401


def test_a_revoked_token_is_worth_nothing_at_once(service: Service) -> None:
    assert service.put(some_run(), [some_row()]).status_code == 201
    TokenBook(service.store).revoke("upload")
    assert service.put(some_run(run_id="later"), [some_row(run_id="later")]).status_code == 401


def test_guessing_tokens_is_slowed_down_and_tells_nothing(make_service: Maker) -> None:
    service = make_service(wrong_tokens=5)
    real = service.as_("upload")["Authorization"]
    answers = []
    for number in range(8):
        guess = real[:-1] + "_" if number % 2 else f"Bearer sb_{number:012x}_{'A' * 43}"
        answers.append(service.client.put("/api/v1/runs/x", content=b"{}", headers={"Authorization": guess}))
    assert [answer.status_code for answer in answers] == [401] * 5 + [429] * 3
    assert len({answer.json()["detail"] for answer in answers[:5]}) == 1
    assert int(answers[-1].headers["retry-after"]) >= 1
    # the right one is not told apart while the address is slowed down
    assert service.client.put("/api/v1/runs/x", content=b"{}", headers={"Authorization": real}).status_code == 429


def test_an_address_may_not_ask_too_often(make_service: Maker) -> None:
    service = make_service(requests_a_second=0.001, burst=3)
    found = [service.client.get("/runs.json").status_code for _ in range(4)]
    assert found == [200, 200, 200, 429]
    assert service.client.get("/healthz").status_code == 200


def test_a_replayed_upload_changes_nothing(service: Service) -> None:
    run, rows = some_run(), [some_row()]
    for _ in range(3):
        service.put(run, rows)
    assert len(service.store.runs()) == 1
    assert len(service.store.rows(run.run_id)) == 1


@pytest.mark.parametrize("site", ["cross-site", "same-site"])
def test_pages_of_other_sites_change_nothing(service: Service, site: str) -> None:
    headers = {"Sec-Fetch-Site": site, "Origin": "https://evil.example"}
    refused = service.put(some_run(), [some_row()], **headers)
    assert refused.status_code == 403
    assert service.store.runs() == []
    seen = service.client.get("/runs.json", headers=headers)
    assert "access-control-allow-origin" not in seen.headers
    asked = service.client.options("/api/v1/runs/x", headers=headers | {"Access-Control-Request-Method": "PUT"})
    assert asked.status_code == 405


@pytest.mark.parametrize("host", ["evil.example", "evil.example:80", "testserver.evil.example", ""])
def test_the_service_answers_under_its_own_names_only(service: Service, host: str) -> None:
    assert service.client.get("/runs.json", headers={"Host": host}).status_code == 421


def test_every_answer_has_the_headers_that_hold_a_browser_back(filled: Service) -> None:
    for path in ("/runs", "/runs.json", "/runs.csv", "/nothing", "/healthz", "/api/openapi.json", "/api/docs"):
        headers = filled.client.get(path).headers
        assert headers["x-content-type-options"] == "nosniff"
        assert headers["x-frame-options"] == "DENY"
        assert headers["referrer-policy"] == "no-referrer"
        assert "frame-ancestors 'none'" in headers["content-security-policy"]
        assert "default-src 'none'" in headers["content-security-policy"]


def test_the_documentation_has_a_nonce_of_its_own_each_time(service: Service) -> None:
    first, second = (service.client.get("/api/docs") for _ in range(2))
    assert first.headers["content-security-policy"] != second.headers["content-security-policy"]
    assert "http://" not in first.text
    assert "https://" not in first.text
    nonce = first.headers["content-security-policy"].partition("'nonce-")[2].partition("'")[0]
    assert first.text.count(f'nonce="{nonce}"') == first.text.count("<script") == 3


def test_faults_do_not_tell_where_the_service_keeps_things(service: Service, monkeypatch: Any) -> None:
    from shadowbench.errors import StoreError
    from shadowbench.service import answers

    def failing(*_: Any, **__: Any) -> Any:
        raise StoreError(f"{service.settings.results}: broken")

    monkeypatch.setattr(answers, "machines", failing)
    answer = service.client.get("/machines.json")
    assert answer.status_code == 503
    assert str(service.settings.results) not in answer.text

    def wrong(*_: Any, **__: Any) -> Any:
        raise ZeroDivisionError("secret")

    monkeypatch.setattr(answers, "machines", wrong)
    answer = service.client.get("/machines.json")
    assert answer.status_code == 500
    assert "secret" not in answer.text


def test_the_scope_of_a_token_is_what_it_was_made_for(service: Service) -> None:
    assert {scope.value for scope in Scope} == {"read", "upload", "admin"}
