"""``export``, ``import``, ``backup``, ``restore`` and ``token`` as a user types them."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

from shadowbench.store import Store


def test_runs_go_from_one_folder_to_another_through_a_file(command: Callable[..., Any], results: Path) -> None:
    done = command("export", "latest", "20250101", "-o", "two.zip", "--results", str(results))
    assert (done.status, done.out) == (0, "two.zip\n")
    done = command("import", "two.zip", "--results", "other")
    assert done.status == 0
    assert "run 20260131-120000-abcd: created, 2 rows" in done.out
    again = command("import", "two.zip", "--results", "other")
    assert again.out.count("unchanged") == 2
    with Store.open(results) as old, Store.open(Path("other")) as new:
        assert new.rows("20260131-120000-abcd") == old.rows("20260131-120000-abcd")


def test_a_backup_becomes_a_folder_again(command: Callable[..., Any], results: Path) -> None:
    assert command("backup", "all.zip", "--results", str(results)).status == 0
    assert command("restore", "all.zip", "--results", "again").status == 0
    assert "20260131-120000-abcd" in command("list", "runs", "--results", "again").out
    refused = command("restore", "all.zip", "--results", "again")
    assert refused.status == 2
    assert "is not empty" in refused.err


def test_a_token_is_printed_once_and_listed_without_its_secret(command: Callable[..., Any], results: Path) -> None:
    where = ("--results", str(results))
    made = command("token", "create", "--name", "lab", "--expires", "12h", *where)
    assert made.status == 0
    assert re.fullmatch(r"sb_[0-9a-f]{12}_[A-Za-z0-9_-]{43}\n", made.out)
    listed = command("token", "list", *where)
    assert "lab" in listed.out
    assert "valid" in listed.out
    assert made.out.split("_", 2)[2].strip() not in listed.out + made.err
    assert command("token", "revoke", "lab", *where).status == 0
    assert "revoked" in command("token", "list", *where).out


def test_wrong_spans_scopes_and_databases_are_one_line(command: Callable[..., Any], results: Path) -> None:
    create = ("token", "create", "--name", "a", "--results", str(results))
    for arguments, message in (
        ((*create, "--expires", "soon"), "is not a span like 12h"),
        ((*create, "--scope", "uplod"), "did you mean 'upload'"),
        ((*create, "--database", "mysql://somewhere/x"), "'mysql' databases are not supported"),
        ((*create, "--database", "::"), "is not like postgresql://"),
    ):
        done = command(*arguments)
        assert done.status == 2
        assert message in done.err
        assert done.err.count("\n") == 1


def test_a_server_that_is_not_there_is_one_line_without_the_password(command: Callable[..., Any]) -> None:
    done = command("token", "list", "--database", "postgresql://me:secret@127.0.0.1:1/x")
    assert done.status == 2
    assert "cannot open the results" in done.err
    assert "secret" not in done.err
    assert done.err.count("\n") == 1
