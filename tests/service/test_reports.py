"""A run's report is made once, kept packed, and made again when the run changes."""

from __future__ import annotations

import gzip
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import anyio
import pytest
from service.conftest import Service
from stored_rows import some_row, some_run

from shadowbench import report
from shadowbench.service.reports import Reports
from shadowbench.store import Store
from shadowbench.store.catalogue import Catalogue
from shadowbench.store.uploads import Uploader, put_run

PATH = "/runs/run-1/report"


@pytest.fixture
def made(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The runs that reports are made of from here on."""
    found: list[str] = []
    make = report.html

    def counted(store: Store, run: Any) -> str:
        found.append(run.run_id)
        return make(store, run)

    monkeypatch.setattr(report, "html", counted)
    return found


def files(service: Service) -> list[Path]:
    return sorted((service.settings.results / "kept-reports").glob("*"))


def test_it_is_made_once_and_sent_packed_or_not(filled: Service, made: list[str]) -> None:
    first = filled.client.get(PATH)
    plain = filled.client.get(PATH, headers={"Accept-Encoding": "identity"})
    assert (first.status_code, plain.status_code, made) == (200, 200, ["run-1"])
    assert (first.headers["content-encoding"], "content-encoding" in plain.headers) == ("gzip", False)
    assert first.text == plain.text == report.html(filled.store, filled.store.find_run("run-1"))
    assert first.headers["content-security-policy"].endswith("; frame-ancestors 'none'")
    assert "'sha256-" in first.headers["content-security-policy"]
    (kept,) = files(filled)
    assert gzip.decompress(kept.read_bytes()).decode() == first.text
    again = filled.client.get(PATH, headers={"If-None-Match": first.headers["etag"]})
    assert (again.status_code, again.content) == (304, b"")


def test_many_who_ask_at_once_wait_for_one(filled: Service, made: list[str]) -> None:
    with ThreadPoolExecutor(6) as readers:
        texts = {answer.text for answer in readers.map(filled.client.get, [PATH] * 6)}
    assert (len(texts), made) == (1, ["run-1"])


def test_it_is_made_again_when_the_run_is_another_and_only_then(service: Service, made: list[str]) -> None:
    def titled(title: str) -> str:
        run = some_run(run_id="run-1", title=title)
        service.put(run, [some_row(run_id="run-1", measured_at=run.created_at)])
        text: str = service.client.get(PATH).text
        return text

    assert "the first" in titled("the first")
    assert "the second" in titled("the second")  # as many rows, measured at the same time
    service.put(some_run(run_id="other"), [some_row(run_id="other")])
    assert "the second" in service.client.get(PATH).text
    assert made == ["run-1", "run-1"]


def test_it_is_made_again_when_a_case_is_measured_again_here(service: Service, made: list[str]) -> None:
    service.store.start_run(some_run(run_id="run-1"))
    reports = []
    for percent in (12.25, 37.75):
        row = some_row(run_id="run-1", failure_percent=percent, measured_at=f"2026-01-01T00:00:{percent}+00:00")
        service.store.add_row(row)
        reports += [service.client.get(PATH).text, service.client.get(PATH).text]
    assert reports[0] == reports[1] != reports[2] == reports[3]
    assert len(made) == 2


def test_there_is_none_of_a_run_that_is_not_there(filled: Service) -> None:
    assert filled.client.get("/runs/missing/report").status_code == 404
    assert files(filled) == []


def test_the_oldest_are_thrown_away_when_they_take_too_much(tmp_path: Path) -> None:
    with Store.open(tmp_path / "results") as store:
        for number in range(4):
            put_run(store, some_run(run_id=f"r{number}"), [some_row(run_id=f"r{number}")], Uploader("anna"))
        catalogue = Catalogue(store)
        size = len(anyio.run(Reports(store, catalogue).of, "r0").packed)
        few = Reports(store, catalogue, most_bytes=size * 5 // 2)
        keys = [anyio.run(few.of, f"r{number}").key for number in range(4)]
        catalogue.close()
    assert {path.name.split(".")[0] for path in (tmp_path / "results" / "kept-reports").iterdir()} == set(keys[2:])


def test_one_that_cannot_be_kept_is_sent_all_the_same(filled: Service, made: list[str]) -> None:
    (filled.settings.results / "kept-reports").write_text("in the way")
    assert filled.client.get(PATH).text == filled.client.get(PATH).text
    assert made == ["run-1", "run-1"]
