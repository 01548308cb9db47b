"""``shadowbench view --pixel``: a receiver of a measured case in numbers."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from inspection_cases import measured

from shadowbench.rows import ResultRow
from shadowbench.store import Store


@pytest.fixture(scope="module")
def case(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, ResultRow]:
    """Return a results folder with one measured case."""
    folder = tmp_path_factory.mktemp("cases")
    (row,) = measured(folder, "pcf:resolution=64")
    return folder, row


def test_a_receiver_as_json_is_one_line(command: Callable[..., Any], case: tuple[Path, ResultRow]) -> None:
    folder, row = case
    ended = command("view", row.case_key[:8], "--pixel", "24,25", "--results", str(folder), "--json")
    assert (ended.status, ended.err) == (0, "")
    (line,) = ended.out.splitlines()
    said = json.loads(line)
    assert (said["case_key"], said["notes"], said["pixel"]) == (row.case_key, [], [24, 25])
    assert said["receiver"]["account"]["visibility"] == said["receiver"]["visibility"][0]


def test_text_shows_the_formula_and_the_taps(command: Callable[..., Any], case: tuple[Path, ResultRow]) -> None:
    folder, row = case
    ended = command("view", row.case_key, "--pixel", "24,25", "--results", str(folder))
    assert (ended.status, ended.err) == (0, "")
    for expected in ("truth", "filtered truth", "weight", "stored depth", "visibility", "=> "):
        assert expected in ended.out


def test_a_pixel_of_the_sky_is_told_with_the_nearest_that_is_not(capsys: pytest.CaptureFixture[str]) -> None:
    from shadowbench.cli.receiver_text import show

    show(
        {
            "method": "pcf",
            "view": "a view",
            "case_key": "1",
            "run_id": "2",
            "pixel": [3, 4],
            "receiver": None,
            "nearest": [3, 9],
        }
    )
    assert "pixel 3,4 sees nothing (sky); the nearest pixel with a receiver is 3,9" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("selector", "options", "message"),
    [
        ("nothing", ("--pixel", "1,1"), "no case whose key begins with 'nothing'"),
        ("latest:", ("--pixel", "1,1"), "named by its key"),
        ("", ("--pixel", "1,1"), "named by its key"),
        ("{key}", ("--pixel", "1x1"), "X,Y"),
        ("{key}", ("--pixel", "1,1", "-o", "a.png"), "without --pixel"),
        ("{key}", ("--json",), "need --pixel"),
        ("{key}", ("-o", "a.gif"), ".png, .jpg or .html"),
    ],
)
def test_wrong_usage_is_one_line(
    command: Callable[..., Any], case: tuple[Path, ResultRow], selector: str, options: tuple[str, ...], message: str
) -> None:
    folder, row = case
    ended = command("view", selector.format(key=row.case_key), *options, "--results", str(folder))
    assert ended.status == 2
    (line,) = ended.err.splitlines()
    assert message in line


def test_the_case_in_space_is_a_page(command: Callable[..., Any], case: tuple[Path, ResultRow], tmp_path: Path) -> None:
    folder, row = case
    ended = command("view", row.case_key, "-o", "view.html", "--results", str(folder))
    assert (ended.status, ended.out, ended.err) == (0, "view.html\n", "")
    assert "<canvas" in (tmp_path / "view.html").read_text()


def test_a_case_that_was_not_measured_has_nothing_to_view(command: Callable[..., Any], results: Path) -> None:
    with Store.open(results) as store:
        (skipped,) = (r for r in store.rows(store.find_run("latest").run_id) if r.outcome.value == "skipped")
    ended = command("view", skipped.case_key, "--pixel", "1,1", "--results", str(results))
    assert ended.status == 2
    assert "ended as skipped" in ended.err
