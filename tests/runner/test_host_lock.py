"""One at a time a machine, first come first served, and nobody waits for the dead."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from shadowbench.runner.cluster.host_lock import lock_folder, only_job_here

HOLD = """
import sys
from pathlib import Path
from shadowbench.runner.cluster.host_lock import only_job_here

def say(text): print(text, flush=True)

with only_job_here(Path(sys.argv[1]), lambda: say("waits")):
    say("holds")
    sys.stdin.readline()
"""


def holder(folder: Path) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-c", HOLD, str(folder)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )


def said(process: subprocess.Popen[str]) -> str:
    assert process.stdout is not None
    return process.stdout.readline().strip()


def let_go(process: subprocess.Popen[str]) -> None:
    process.communicate("\n")
    assert process.returncode == 0


def test_one_holds_it_at_a_time_and_those_who_wait_get_it_in_their_order(tmp_path: Path) -> None:
    first = holder(tmp_path)
    assert said(first) == "holds"
    second = holder(tmp_path)
    assert said(second) == "waits"
    third = holder(tmp_path)
    assert said(third) == "waits"
    let_go(first)
    assert said(second) == "holds"
    assert said(third) == "waits", "on the second now"
    let_go(second)
    assert said(third) == "holds"
    let_go(third)
    assert {file.name for file in tmp_path.iterdir()} == {"door"}


def test_a_dead_holder_and_a_dead_waiter_hold_nobody_up(tmp_path: Path) -> None:
    first = holder(tmp_path)
    assert said(first) == "holds"
    second = holder(tmp_path)
    assert said(second) == "waits"
    for process in (second, first):
        process.kill()
        process.communicate()
    with only_job_here(tmp_path, lambda: None):
        pass
    assert {file.name for file in tmp_path.iterdir()} == {"door"}


def test_the_folder_is_the_machines_unless_named(tmp_path: Path, monkeypatch) -> None:  # type: ignore[no-untyped-def]
    monkeypatch.delenv("SHADOWBENCH_HOST_LOCK", raising=False)
    assert lock_folder().name == "shadowbench"
    monkeypatch.setenv("SHADOWBENCH_HOST_LOCK", str(tmp_path))
    assert lock_folder() == tmp_path
