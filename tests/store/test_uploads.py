"""Whole runs into the store: once, wholly, by whom they belong to; and the tokens that say who that is."""

from __future__ import annotations

import datetime as dt
from typing import Any

import pytest
from stored_rows import some_row, some_run, with_pictures

from shadowbench.errors import StoreError
from shadowbench.rows import ResultRow
from shadowbench.store import Store, tokens
from shadowbench.store import uploads as uploads_module
from shadowbench.store.access_models import StoredAudit
from shadowbench.store.tokens import Scope, TokenBook
from shadowbench.store.uploads import ConflictError, Kept, MissingArtifactsError, Uploader, put_run

RUN = some_run()
ANNA, BEN = Uploader("anna", "10.0.0.1"), Uploader("ben", "10.0.0.2")


def audit(store: Store) -> list[tuple[str, str, str]]:
    with store.session("read the audit trail") as session:
        return [(line.action, line.subject, line.token_id) for line in session.query(StoredAudit).order_by("id")]


def test_a_run_that_is_put_twice_is_there_once(store: Store) -> None:
    rows = [some_row("pcf"), some_row("esm")]
    assert put_run(store, RUN, rows, ANNA).kept is Kept.CREATED
    assert put_run(store, RUN, rows, ANNA).kept is Kept.UNCHANGED
    assert store.rows(RUN.run_id) == rows
    assert audit(store) == [("run created", RUN.run_id, "anna")]


def test_its_owner_may_replace_a_run_and_nobody_else(store: Store) -> None:
    put_run(store, RUN, [some_row("pcf")], ANNA)
    with pytest.raises(ConflictError, match="was uploaded with another token"):
        put_run(store, RUN, [some_row("esm")], BEN)
    assert put_run(store, RUN, [some_row("vsm")], ANNA).kept is Kept.REPLACED
    assert [row.method for row in store.rows(RUN.run_id)] == ["vsm"]


def test_a_run_that_was_measured_here_is_not_replaced(store: Store) -> None:
    store.start_run(RUN)
    with pytest.raises(ConflictError, match="was measured here"):
        put_run(store, RUN, [], ANNA)


def test_a_run_whose_pictures_are_missing_is_not_kept(store: Store, tmp_path: Any) -> None:
    with Store.open(tmp_path / "elsewhere") as elsewhere:
        row = with_pictures(elsewhere, some_row())
    with pytest.raises(MissingArtifactsError) as caught:
        put_run(store, RUN, [row], ANNA)
    assert caught.value.names == list(row.artifacts.values())
    assert store.runs() == []


def test_a_failure_in_the_middle_leaves_nothing_of_a_run(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    def failing(*_: Any) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(uploads_module, "add_to_audit", failing)
    with pytest.raises(StoreError, match="no space left on device"):
        put_run(store, RUN, [some_row()], ANNA)
    assert store.runs() == []
    assert store.rows(RUN.run_id) == []


def test_many_rows_keep_their_order_and_what_belongs_to_each(store: Store) -> None:
    rows: list[ResultRow] = [
        some_row(counters={f"c{i}": i}, stages={"s": float(i)}, samples={"build": [float(i)] * 3}) for i in range(250)
    ]
    put_run(store, RUN, rows, ANNA)
    assert store.rows(RUN.run_id) == rows


def test_a_token_is_found_by_its_text_only(store: Store) -> None:
    book = TokenBook(store)
    token, text = book.create("lab", Scope.UPLOAD, dt.timedelta(days=1))
    found = book.check(text)
    assert found is not None
    assert (found.token_id, found.scope, found.name) == (token.token_id, Scope.UPLOAD, "lab")
    wrong = text[:-1] + ("A" if text[-1] != "A" else "B")
    for other in ("", "sb_", wrong, text + "x", text.upper(), f"sb_{'0' * 12}_{'A' * 43}", "' OR 1=1 --", "é" * 60):
        assert book.check(other) is None


def test_the_secret_of_a_token_is_nowhere_in_the_store(store: Store) -> None:
    _, text = TokenBook(store).create("lab", Scope.READ, None)
    secret = text.split("_", 2)[2]
    with store.session("read all") as session:
        for table in ("tokens", "audit"):
            from sqlalchemy import text as sql

            assert secret not in str(session.execute(sql(f"SELECT * FROM {table}")).all())
    assert secret not in repr(TokenBook(store).tokens())


def test_a_token_that_was_revoked_or_has_expired_is_worth_nothing(store: Store) -> None:
    book = TokenBook(store)
    _, revoked = book.create("a", Scope.UPLOAD, None)
    _, expired = book.create("b", Scope.UPLOAD, dt.timedelta(seconds=-1))
    book.revoke("a")
    assert book.check(revoked) is None
    assert book.check(expired) is None
    assert [token.state for token in book.tokens()] in (["revoked", "expired"], ["expired", "revoked"])
    assert not book.any_valid(Scope.READ)


def test_the_last_use_of_a_token_is_noted_at_most_once_a_minute(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    book = TokenBook(store)
    _, text = book.create("lab", Scope.READ, None)
    assert book.tokens()[0].last_used_at is None
    book.check(text)
    first = book.tokens()[0].last_used_at
    assert first is not None

    def never(*_: Any, **__: Any) -> Any:
        raise AssertionError

    monkeypatch.setattr(tokens, "update", never)
    book.check(text)
    assert book.tokens()[0].last_used_at == first


def test_a_scope_includes_those_before_it() -> None:
    assert [[a.includes(b) for b in Scope] for a in Scope] == [
        [True, False, False],
        [True, True, False],
        [True, True, True],
    ]


def test_a_token_that_is_not_there_cannot_be_revoked(store: Store) -> None:
    book = TokenBook(store)
    book.create("lab", Scope.READ, None)
    book.create("twin", Scope.READ, None)
    book.create("twin", Scope.READ, None)
    with pytest.raises(StoreError, match="no token is called 'lap'; did you mean 'lab'"):
        book.revoke("lap")
    with pytest.raises(StoreError, match="2 tokens are called 'twin'"):
        book.revoke("twin")
