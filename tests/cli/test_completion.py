"""What the shell completes."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from shadowbench.cli import completion
from shadowbench.experiment import builtin_names
from shadowbench.experiment_groups import groups
from shadowbench.plugins import Registry


def test_names_are_completed_from_their_beginning() -> None:
    assert completion.methods("shadow") == [name for name in Registry().names("method") if name.startswith("shadow")]
    assert completion.scenes("") == Registry().names("scene")
    assert completion.anything("zzz") == []
    assert completion.formats("mark") == ["markdown"]
    assert completion.what_to_list("s") == ["scenes"]


def test_experiments_and_toml_files_are_completed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "folder").mkdir()
    for name in ("mine.toml", "folder/other.toml"):
        (tmp_path / name).touch()
    assert completion.experiments("") == [*builtin_names(), *groups(), "mine.toml"]
    assert completion.experiments("folder/o") == ["folder/other.toml"]


def test_runs_are_completed(results: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SHADOWBENCH_RESULTS", str(results))
    assert completion.runs("") == ["latest", "20260131-120000-abcd", "20250101-000000-0000"]
    assert completion.runs("2026") == ["20260131-120000-abcd"]


def test_what_goes_wrong_completes_to_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SHADOWBENCH_RESULTS", str(tmp_path / "nowhere"))
    assert completion.runs("") == []


def test_shell_asks_and_is_answered() -> None:
    asking = {"_SHADOWBENCH_COMPLETE": "complete_bash", "COMP_WORDS": "shadowbench show box-on", "COMP_CWORD": "2"}
    code = "import sys; from shadowbench.cli import main; sys.exit(main())"
    ended = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=False, env=os.environ | asking
    )
    assert ended.stdout.split() == ["box-on-plane"]
