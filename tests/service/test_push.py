"""``push`` to a service in a process of its own: resumed, repeated, refused; the token stays secret."""

from __future__ import annotations

import http.server
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from service.live import Live, serving
from stored_rows import some_row, some_run, with_pictures

from shadowbench.cli import main
from shadowbench.errors import UsageError
from shadowbench.service.client import ATTEMPTS, Client, PushError, find_token
from shadowbench.store import Store
from shadowbench.store.tokens import Scope, TokenBook

RUN = some_run(case_count=3)


@pytest.fixture(scope="module")
def theirs(tmp_path_factory: pytest.TempPathFactory, lasting_database: str | None) -> Iterator[tuple[Live, Store, str]]:
    """A service, its store and a token."""
    folder = tmp_path_factory.mktemp("theirs") / "results"
    with Store.open(folder, database=lasting_database) as store:
        _, token = TokenBook(store).create("lab", Scope.UPLOAD, None)
        with serving(folder, database=lasting_database) as live:
            yield live, store, token


@pytest.fixture
def ours(tmp_path: Path) -> Iterator[Store]:
    """A store with a run of three cases with pictures, each run of a test with an id of its own."""
    with Store.open(tmp_path / "ours") as store:
        run = RUN.model_copy(update={"run_id": tmp_path.name})
        store.start_run(run)
        for number, method in enumerate(("pcf", "esm", "vsm"), 1):
            row = some_row(method, run_id=run.run_id, case_key=f"{number:020x}")
            store.add_row(with_pictures(store, row))  # two pictures of its own, and the reference
        yield store


def quiet(_: float) -> None:
    """Do not wait."""


def test_a_run_arrives_whole_and_a_second_push_sends_nothing(theirs: Any, ours: Store) -> None:
    live, store, token = theirs
    (run,) = ours.runs()
    client = Client(live.address, token)
    trial = client.push(ours, run, dry_run=True)
    assert (trial.row_count, trial.sent_pictures) == (3, 7)
    assert store.run(run.run_id) is None
    pushed = client.push(ours, run)
    assert (pushed.kept, pushed.sent_pictures, pushed.sent_bytes) == ("created", 7, trial.sent_bytes)
    again = client.push(ours, run)
    assert (again.kept, again.sent_pictures) == ("unchanged", 0)
    client.close()
    assert store.rows(run.run_id) == ours.rows(run.run_id)
    for row in ours.rows(run.run_id):
        for name in row.artifacts.values():
            assert store.artifact(name) == ours.artifact(name)


def test_the_command_pushes_and_never_prints_the_token(
    theirs: Any, ours: Store, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    live, _, token = theirs
    monkeypatch.setenv("SHADOWBENCH_TOKEN", token)
    arguments = ["push", "latest", live.address, "--results", str(ours.folder)]
    assert main([*arguments, "--dry-run"]) == 0
    assert "would be sent" in capfd.readouterr().out
    assert main(arguments) == 0
    printed = capfd.readouterr()
    assert "created, 3 rows" in printed.out
    assert "of 7 pictures" in printed.out
    monkeypatch.setenv("SHADOWBENCH_TOKEN", token[:-1] + "_")
    assert main(arguments) == 2
    refused = capfd.readouterr()
    assert "the token is not valid" in refused.err
    assert refused.err.count("\n") == 1
    assert token.rpartition("_")[2][:20] not in printed.out + printed.err + refused.err + live.log.read_text()


class _Flaky(http.server.BaseHTTPRequestHandler):
    """Fails in several ways before it answers."""

    plan: list[int]
    seen: list[str]

    def do_POST(self) -> None:
        self._answer(b'{"missing": []}')

    def do_PUT(self) -> None:
        self._answer(b'{"kept": "created"}')

    def _answer(self, content: bytes) -> None:
        self.rfile.read(int(self.headers["Content-Length"]))
        type(self).seen.append(self.command)
        status = type(self).plan.pop(0) if type(self).plan else 200
        if status == 0:
            self.connection.close()
            return
        body = content if status == 200 else b'{"detail": "not now"}'
        self.send_response(status)
        self.send_header("Content-Length", str(len(body)))
        if status == 429:
            self.send_header("Retry-After", "7")
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, *_: Any) -> None:
        pass


@pytest.fixture
def flaky() -> Iterator[Callable[[list[int]], str]]:
    """Return a function that starts a server with a plan of statuses; 0 breaks the connection."""
    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), _Flaky)
    thread = threading.Thread(target=server.serve_forever)
    thread.start()

    def begin(plan: list[int]) -> str:
        _Flaky.plan, _Flaky.seen = plan, []
        return f"http://127.0.0.1:{server.server_port}"

    yield begin
    server.shutdown()
    server.server_close()
    thread.join()


def test_what_may_pass_is_tried_again_after_growing_pauses(flaky: Any, ours: Store) -> None:
    pauses: list[float] = []
    client = Client(flaky([503, 0, 429, 200, 500, 200]), "sb_x", pause=pauses.append)
    assert client.push(ours, ours.runs()[0]).kept == "created"
    client.close()
    assert _Flaky.seen == ["POST"] * 4 + ["PUT"] * 2
    assert len(pauses) == 4
    assert pauses[1] > pauses[0]
    assert pauses[2] == 7.0


def test_what_will_not_pass_is_said_at_once(flaky: Any, ours: Store) -> None:
    for status in (400, 401, 403, 404, 409, 413, 422, 507):
        client = Client(flaky([status]), "sb_x", pause=quiet)
        with pytest.raises(PushError, match=rf"not now \({status}\)"):
            client.push(ours, ours.runs()[0])
        client.close()
        assert _Flaky.seen == ["POST"]


def test_it_gives_up_in_the_end(flaky: Any, ours: Store) -> None:
    client = Client(flaky([503] * 50), "sb_x", pause=quiet)
    with pytest.raises(PushError, match=f"gave up after {ATTEMPTS} attempts"):
        client.push(ours, ours.runs()[0])
    client.close()
    assert len(_Flaky.seen) == ATTEMPTS


def test_a_run_that_has_not_ended_is_not_pushed(ours: Store) -> None:
    run = some_run(run_id="going", status="running", finished_at=None)
    ours.start_run(run)
    with pytest.raises(PushError, match="has not ended"):
        Client("http://127.0.0.1:1", "sb_x").push(ours, run)


@pytest.mark.parametrize(
    ("address", "message"),
    [
        ("results.example.org", "is not an address"),
        ("ftp://results.example.org", "is not an address"),
        ("http://me:pw@127.0.0.1/", "is not an address"),
        ("http://127.0.0.1:port", "is not an address"),
        ("http://results.example.org", "sent in the clear"),
    ],
)
def test_addresses_that_would_give_the_token_away_are_refused(address: str, message: str) -> None:
    with pytest.raises(UsageError, match=message):
        Client(address, "sb_x")


def test_a_token_file_that_others_may_read_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("SHADOWBENCH_TOKEN", raising=False)
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    with pytest.raises(UsageError, match="there is no token: set SHADOWBENCH_TOKEN"):
        find_token()
    file = tmp_path / "shadowbench" / "token"
    file.parent.mkdir()
    file.write_text("sb_secret\n")
    file.chmod(0o644)
    with pytest.raises(UsageError, match="chmod 600") as caught:
        find_token()
    assert "sb_secret" not in str(caught.value)
    file.chmod(0o600)
    assert find_token() == "sb_secret"
    monkeypatch.setenv("SHADOWBENCH_TOKEN", "sb_other")
    assert find_token() == "sb_other"
    assert find_token(file) == "sb_secret"
