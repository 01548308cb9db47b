"""``list`` and ``show``."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from shadowbench.plugins import Registry

Command = Callable[..., Any]

BROKEN_METHOD = """
from shadowbench.method import Method

class Picky(Method):
    '''A method whose availability test fails.'''
    name = "picky"
    title = "Picky [bold]shadows[/bold]"
    counters = {"rays": "rays cast"}

    @classmethod
    def available(cls):
        raise RuntimeError("no idea")

    def build(self, casters, light, view, changes, trace): ...
    def shade(self, receivers, visibility, trace): ...
"""


@pytest.fixture
def plugin(tmp_path: Path) -> str:
    path = tmp_path / "picky.py"
    path.write_text(BROKEN_METHOD, encoding="utf-8")
    return str(path)


@pytest.mark.parametrize("kind", ["method", "scene"])
def test_every_plugin_is_listed(command: Command, kind: Any) -> None:
    ended = command("list", f"{kind}s")
    listed = [line.split()[0] for line in ended.out.splitlines()[1:] if not line.startswith(" ")]
    assert ended.status == 0
    assert listed == Registry().names(kind)


def test_plugin_whose_test_fails_is_listed_with_its_error(command: Command, plugin: str) -> None:
    ended = command("list", "methods", "--plugin", plugin)
    assert ended.status == 0
    assert "Picky [bold]shadows[/bold]" in ended.out
    assert "no idea" in " ".join(ended.out.split())


def test_method_is_shown_with_what_it_declares(command: Command) -> None:
    out = command("show", "shadow-map").out
    for expected in ("Shadow maps", "Williams 1978", "resolution", "texels", "triangles drawn", "peter-panning"):
        assert expected in out


def test_a_method_says_when_it_builds(command: Command, tmp_path: Path) -> None:
    path = tmp_path / "watchful.py"
    watching = BROKEN_METHOD.replace("    def build(", "    def is_view_dependent(self): return True\n\n    def build(")
    path.write_text(watching, encoding="utf-8")
    assert "belongs to every frame" in command("show", "picky", "--plugin", str(path)).out
    assert "when the light or a caster moves" in command("show", "shadow-map").out


def test_plugin_from_a_file_is_shown(command: Command, plugin: str) -> None:
    out = command("show", "picky", "--plugin", plugin).out
    assert "A method whose availability test fails." in out
    assert "rays cast" in out


def test_scene_is_shown_with_its_parameters(command: Command) -> None:
    out = command("show", "random-triangles").out
    assert "Aila and Laine" in out
    assert "seed" in out


def test_experiment_file_is_shown(command: Command, tmp_path: Path) -> None:
    text = 'title = "Two maps"\n[[comparison]]\nscene = "bunny"\nmethod = "shadow-map:resolution=256/512"\n'
    (tmp_path / "mine.toml").write_text(text, encoding="utf-8")
    out = command("show", "mine.toml").out
    assert "Two maps" in out
    assert "shadow-map:resolution=256/512" in out


def test_runs_are_listed_newest_first(command: Command, results: Path) -> None:
    lines = command("list", "runs", "--results", str(results)).out.splitlines()
    assert [line.split()[0] for line in lines[1:]] == ["20260131-120000-abcd", "20250101-000000-0000"]
    assert "1 ok, 1 skipped" in lines[1]


def test_groups_and_how_to_write_files_are_shown(command: Command) -> None:
    listed = command("list", "experiments").out
    assert "papers" in listed
    shown = command("show", "annen-2008")
    assert shown.status == 0
    assert "annen-2008-table-1" in shown.out
    assert "[[claim]]" in command("show", "claims").out
    assert "[[comparison]]" in command("show", "experiment-file").out
    assert "did you mean 'claims'" in command("show", "claim").err


def test_an_experiments_claims_are_shown_with_their_tests(command: Command) -> None:
    shown = " ".join(command("show", "annen-2008-table-3").out.split())
    assert "z-max-finds-no-fewer" in shown
    assert "less than 10" in shown
