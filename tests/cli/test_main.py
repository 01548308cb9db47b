"""Every way a command can end: one line, an exit status, and never a traceback."""

from __future__ import annotations

import errno
import os
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import shadowbench
from shadowbench.cli import main
from shadowbench.cli.exit_status import ExitStatus
from shadowbench.errors import SceneError

Command = Callable[..., Any]

ALLOWED = {"typer", "click", "rich", "shellingham", "annotated_doc", "typing_extensions"}
"""Third-party packages that ``--help`` may import: typer and what it brings."""


def python(code: str, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=False, env=os.environ | environment
    )


def failing_with(monkeypatch: pytest.MonkeyPatch, error: BaseException) -> None:
    def fail(*arguments: object, **options: object) -> None:
        raise error

    monkeypatch.setattr("shadowbench.cli.results.open_store", fail)


@pytest.mark.parametrize("arguments", [["--help"], ["--version"]])
def test_help_imports_nothing_heavy(arguments: list[str]) -> None:
    code = (
        "import sys; before = set(sys.modules); from shadowbench.cli import main; status = main({!r}); "
        "print('MODULES', *sorted({{m.partition('.')[0] for m in set(sys.modules) - before}})); sys.exit(status)"
    )
    ended = python(code.format(arguments))
    assert ended.returncode == 0, ended.stderr
    loaded = set(ended.stdout.rpartition("MODULES")[2].split())
    foreign = {name for name in loaded - set(sys.stdlib_module_names) if not name.startswith("_")}
    assert foreign - {"shadowbench"} <= ALLOWED


def test_module_runs_as_the_command_does() -> None:
    ended = subprocess.run(
        [sys.executable, "-m", "shadowbench", "--version"], capture_output=True, text=True, check=False
    )
    assert (ended.returncode, ended.stdout) == (0, f"shadowbench {shadowbench.__version__}\n")


def test_command_alone_prints_help_and_counts_as_wrong_usage(command: Command) -> None:
    ended = command()
    assert ended.status == ExitStatus.USAGE
    assert "Usage: shadowbench" in ended.out


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["runn"], "no such command 'runn'.*did you mean 'run'"),
        (["run", "--metod", "pcf"], "no such option: --metod.*--method"),
        (["run", "--threads", "0"], "--threads.*1"),
        (["run", "--threads", "many"], "--threads"),
        (["run", "--timeout", "0"], "--timeout must be a positive number, not 0"),
        (["run", "--timeout", "nan"], "--timeout must be a positive number, not nan"),
        (["run", "--memory-limit", "-1"], "--memory-limit must be a positive number"),
        (["run", "-s", "bunny", "--size", "1024"], "WIDTHxHEIGHT"),
        (["run", "-m", "pcf:kernel"], "key=value"),
        (["run", "no-such-experiment"], "no experiment is called 'no-such-experiment'"),
        (["run", "missing.toml"], "missing.toml does not exist"),
        (["table"], "missing argument 'RUN'"),
        (["table", "latest"], "holds no results"),
        (["report", "latest"], "holds no results"),
        (["show", "pfc"], "no method, scene or experiment is called 'pfc'; did you mean 'pcf'"),
        (["list", "method"], "there is no list of 'method'; did you mean 'methods'"),
        (["list", "--plugin", "missing.py"], "plugin file missing.py does not exist"),
    ],
)
def test_wrong_usage_is_one_line_and_status_2(command: Command, arguments: list[str], message: str) -> None:
    ended = command(*arguments)
    assert ended.status == 2
    assert re.fullmatch(f"shadowbench: error: [^\n]*{message}[^\n]*\n", ended.err, re.IGNORECASE)
    assert ended.out == ""


def test_known_error_cannot_colour_the_terminal(command: Command, monkeypatch: pytest.MonkeyPatch) -> None:
    failing_with(monkeypatch, SceneError("mesh '\x1b[31mred'\nsecond line"))
    ended = command("table", "latest")
    assert (ended.status, ended.err) == (2, "shadowbench: error: mesh '\\x1b[31mred' second line\n")


def test_full_disk_is_the_users_to_mend(command: Command, monkeypatch: pytest.MonkeyPatch) -> None:
    failing_with(monkeypatch, OSError(errno.ENOSPC, "No space left on device", "somewhere"))
    ended = command("table", "latest")
    assert (ended.status, ended.err) == (2, "shadowbench: error: somewhere: No space left on device\n")


def test_unforeseen_error_is_one_line_and_its_traceback_a_file(
    command: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    failing_with(monkeypatch, ZeroDivisionError("by zero\nand more"))
    ended = command("table", "latest")
    assert ended.status == ExitStatus.INTERNAL
    assert ended.err.startswith("shadowbench: internal error: ZeroDivisionError: by zero; please report it")
    written = Path(ended.err.rpartition(" is in ")[2].strip())
    assert "Traceback" in written.read_text(encoding="utf-8")
    written.unlink()


def test_debugging_shows_the_traceback(command: Command, monkeypatch: pytest.MonkeyPatch) -> None:
    failing_with(monkeypatch, ZeroDivisionError("by zero"))
    monkeypatch.setenv("SHADOWBENCH_DEBUG", "1")
    assert "Traceback" in command("table", "latest").err


def test_interruption_is_status_130(command: Command, monkeypatch: pytest.MonkeyPatch) -> None:
    failing_with(monkeypatch, KeyboardInterrupt())
    assert command("table", "latest").status == 130


def test_reader_that_has_seen_enough_is_no_error(results: Path) -> None:
    line = f"{sys.executable} -m shadowbench table latest --results {results} -f csv | true; exit ${{PIPESTATUS[0]}}"
    ended = subprocess.run(["bash", "-c", line], capture_output=True, text=True, check=False)
    assert (ended.returncode, ended.stderr) == (ExitStatus.READER_GONE, "")


def test_characters_that_the_terminal_lacks_become_question_marks() -> None:
    command = [sys.executable, "-m", "shadowbench", "show", "pcf"]
    said = [
        subprocess.run(command, capture_output=True, check=True, env=os.environ | {"PYTHONIOENCODING": encoding}).stdout
        for encoding in ("utf-8", "ascii")
    ]
    whole = said[0].decode("utf-8")
    assert not whole.isascii()
    assert said[1].decode("ascii") == re.sub("[^\\x00-\\x7f]", "?", whole)


@pytest.mark.parametrize("arguments", [["table", "latest", "-f", "csv"], ["list", "methods"], ["--help"]])
def test_closed_output_is_no_error(results: Path, arguments: list[str]) -> None:
    line = f"exec {sys.executable} -m shadowbench {' '.join(arguments)} >&-"
    environment = os.environ | {"SHADOWBENCH_RESULTS": str(results)}
    ended = subprocess.run(["bash", "-c", line], capture_output=True, text=True, check=False, env=environment)
    assert (ended.returncode, ended.stderr) == (0, "")


def test_no_colour_off_a_terminal(command: Command, results: Path) -> None:
    assert "\x1b" not in command("table", "latest", "--results", str(results)).out


def test_main_returns_instead_of_exiting() -> None:
    assert main(["--version"]) == 0
