"""``doctor``: findings, remedies, and its exit status."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from shadowbench.cli import machine_checks
from shadowbench.cli.machine_checks import Check, State

Command = Callable[..., Any]


def findings(monkeypatch: pytest.MonkeyPatch, *found: Check) -> None:
    monkeypatch.setattr(machine_checks, "all_checks", lambda results: iter(found))


def test_warnings_leave_the_status_0(command: Command, monkeypatch: pytest.MonkeyPatch) -> None:
    findings(monkeypatch, Check("a", State.OK, "fine"), Check("b", State.WARN, "old", "renew it"))
    ended = command("doctor")
    assert ended.status == 0
    assert "-> renew it" in ended.out
    assert "1 warning" in ended.out


def test_failure_is_status_1(command: Command, monkeypatch: pytest.MonkeyPatch) -> None:
    findings(monkeypatch, Check("a", State.FAIL, "missing", "install it"))
    assert command("doctor").status == 1


def test_check_that_raises_is_a_warning(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    def broken() -> Check:
        raise RuntimeError("no such thing")

    for name in ("versions", "processor", "load", "memory", "warp", "kernel_cache", "graphics"):
        monkeypatch.setattr(machine_checks, name, broken)
    monkeypatch.setattr(machine_checks, "peer", lambda *arguments: broken())
    states = [check.state for check in machine_checks.all_checks(tmp_path)]
    assert State.FAIL not in states
    assert states.count(State.WARN) == 9


def test_missing_package_names_the_command_to_install_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(machine_checks, "library_version", lambda name: None if name == "numpy" else "1.0")
    found = machine_checks.versions()
    assert (found.state, found.remedy) == (State.FAIL, "pip install numpy")


def test_missing_peer_is_a_warning(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(machine_checks, "library_version", lambda name: None)
    found = machine_checks.peer("embreex", "embree", "")
    assert found.state is State.WARN
    assert "shadowbench[peers]" in found.remedy


def test_library_that_takes_its_process_down_is_a_warning(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(machine_checks, "library_version", lambda name: "1.0")
    assert machine_checks.peer("embreex", "embree", "import os; os.abort()").state is State.WARN


def test_results_folder_that_is_a_file_fails(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    assert machine_checks.results_folder(tmp_path / "file").state is State.FAIL
    assert machine_checks.results_folder(tmp_path / "new" / "folder").state is not State.FAIL
