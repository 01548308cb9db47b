"""A run that is asked to end keeps what is finished and ends with status 130."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from shadowbench.cli.interruption import ended_like_ctrl_c
from shadowbench.rows import RunStatus
from shadowbench.store import Store

RUN = ("--scene", "box-on-plane", "--method", "no-shadows", "--method", "shadow-map:resolution=64/128/256")
SMALL = ("--size", "48x32", "--threads", "1", "--budget", "2")


@pytest.mark.slow
@pytest.mark.parametrize("how", [signal.SIGTERM, signal.SIGHUP])
def test_a_run_that_is_asked_to_end_is_interrupted(tmp_path: Path, how: signal.Signals) -> None:
    command = [sys.executable, "-m", "shadowbench", "run", *RUN, *SMALL, "--json", "--results", str(tmp_path)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        assert process.stdout is not None
        told = [json.loads(process.stdout.readline())["case_key"]]
        process.send_signal(how)
        told += [json.loads(line)["case_key"] for line in process.stdout]
        process.wait()
    assert process.returncode == 130
    with Store.open(tmp_path, create=False) as store:
        (record,) = store.runs()
        kept = [row.case_key for row in store.rows(record.run_id)]
    assert record.status is RunStatus.INTERRUPTED
    assert len(kept) < record.case_count
    assert sorted(kept) == sorted(told)


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_a_signal_becomes_an_interruption_and_is_what_it_was_afterwards(number: signal.Signals) -> None:
    with pytest.raises(KeyboardInterrupt), ended_like_ctrl_c():
        signal.raise_signal(number)
    assert signal.getsignal(number) is signal.SIG_DFL


def test_what_nohup_ignores_stays_ignored() -> None:
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with ended_like_ctrl_c():
            signal.raise_signal(signal.SIGHUP)
    finally:
        signal.signal(signal.SIGHUP, before)


def test_other_threads_leave_signals_alone() -> None:
    def use() -> None:
        with ended_like_ctrl_c():
            found.append(signal.getsignal(signal.SIGTERM))

    found: list[object] = []
    thread = threading.Thread(target=use)
    thread.start()
    thread.join()
    assert found == [signal.SIG_DFL]
