"""Keeping uploads in a process beside the service's says and does the same as keeping them in its own."""

from __future__ import annotations

import hashlib
import http.client
import json
import multiprocessing
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import psutil
import pytest
from service.live import serving
from stored_rows import png, some_row, some_run, with_pictures

from shadowbench.errors import StoreError
from shadowbench.rows import ResultRow, RunRecord
from shadowbench.service.keeping import Keeper, Keeping, KeepingApart
from shadowbench.service.settings import Settings
from shadowbench.store import Store
from shadowbench.store.documents import DocumentError, row_document, run_document
from shadowbench.store.tokens import Scope, TokenBook
from shadowbench.store.uploads import ConflictError, Kept, MissingArtifactsError, Uploader, digest_of

ANNA, BEN = Uploader("anna", "127.0.0.1"), Uploader("ben")
RUN = some_run(case_count=1)


def as_text(run: RunRecord, rows: list[ResultRow]) -> bytes:
    return json.dumps({"run": run_document(run), "rows": [row_document(row) for row in rows]}).encode()


@pytest.fixture
def store(tmp_path: Path, database: str | None) -> Iterator[Store]:
    with Store.open(tmp_path / "results", database=database) as opened:
        yield opened


@pytest.fixture(params=["here", "apart"])
def keeper(request: pytest.FixtureRequest, store: Store, database: str | None) -> Iterator[Keeper]:
    settings = Settings(results=store.folder, database=database)
    made: Keeper = Keeping(store, settings.most_pixels) if request.param == "here" else KeepingApart(settings)
    yield made
    made.close()
    assert not multiprocessing.active_children()


def name_of(content: bytes) -> str:
    return f"{hashlib.sha256(content).hexdigest()}.png"


def test_what_is_kept_is_in_the_store_and_what_is_refused_says_why(keeper: Keeper, store: Store) -> None:
    rows = [some_row("pcf")]
    kept = keeper.keep_run(RUN.run_id, as_text(RUN, rows), ANNA)
    assert (kept.kept, kept.row_count, kept.digest) == (Kept.CREATED, 1, digest_of(RUN, rows))
    assert store.rows(RUN.run_id) == rows
    assert keeper.keep_run(RUN.run_id, as_text(RUN, rows), ANNA).kept is Kept.UNCHANGED
    with pytest.raises(ConflictError, match="another token"):
        keeper.keep_run(RUN.run_id, as_text(RUN, [some_row("esm")]), BEN)
    with pytest.raises(DocumentError, match="is not the id in the address") as wrong:
        keeper.keep_run("other", as_text(RUN, rows), ANNA)
    assert (wrong.value.place, wrong.value.reason) == ("run.run_id", "is not the id in the address")
    picture = png(3)
    assert keeper.keep_picture(name_of(picture), picture, ANNA)
    assert not keeper.keep_picture(name_of(picture), picture, ANNA)
    assert store.artifact(name_of(picture))
    with pytest.raises(DocumentError, match="SHA-256 of its name"):
        keeper.keep_picture(name_of(picture), png(4), ANNA)


def test_a_run_names_the_pictures_that_it_lacks(keeper: Keeper, tmp_path: Path) -> None:
    with Store.open(tmp_path / "elsewhere") as elsewhere:
        row = with_pictures(elsewhere, some_row())
    with pytest.raises(MissingArtifactsError, match="not in the store") as refused:
        keeper.keep_run(RUN.run_id, as_text(RUN, [row]), ANNA)
    assert set(refused.value.names) == set(row.artifacts.values())


def test_a_process_that_was_killed_loses_one_upload_at_most(store: Store, database: str | None) -> None:
    keeper = KeepingApart(Settings(results=store.folder, database=database))
    assert keeper.keep_run(RUN.run_id, as_text(RUN, [some_row("pcf")]), ANNA).kept is Kept.CREATED
    (process,) = multiprocessing.active_children()
    process.kill()
    process.join()
    with pytest.raises(StoreError, match="ended before this one was kept"):
        keeper.keep_run(RUN.run_id, as_text(RUN, [some_row("esm")]), ANNA)
    assert keeper.keep_run(RUN.run_id, as_text(RUN, [some_row("esm")]), ANNA).kept is Kept.REPLACED
    keeper.close()


@pytest.mark.parametrize("end", [psutil.Process.terminate, psutil.Process.kill])
def test_it_ends_with_the_service(tmp_path: Path, end: Callable[[psutil.Process], None], database: str | None) -> None:
    results = tmp_path / "results"
    with Store.open(results, database=database) as store:
        _, token = TokenBook(store).create("lab", Scope.UPLOAD, None)
    with serving(results, database=database) as live:
        service = psutil.Process(live.process.pid)
        before = set(service.children(recursive=True))
        connection = http.client.HTTPConnection(live.address.removeprefix("http://"), timeout=60)
        headers: dict[str, Any] = {"Authorization": f"Bearer {token}"}
        connection.request("PUT", f"/api/v1/runs/{RUN.run_id}", as_text(RUN, [some_row()]), headers)
        assert connection.getresponse().status == 201
        connection.close()
        beside = set(service.children(recursive=True)) - before
        assert any(process.nice() > service.nice() for process in beside)
        end(service)
        live.process.wait(timeout=60)
        _, alive = psutil.wait_procs(beside, timeout=60)
        assert not alive
