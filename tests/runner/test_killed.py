"""A run that is killed at any moment loses no finished row, leaves no process, and goes on with exactly the rest."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import psutil
import pytest
from small_runs import PLUGIN_FILES, carry_out, planned

from shadowbench.rows import Outcome, RunStatus
from shadowbench.store import Store

pytestmark = pytest.mark.usefixtures("lasting_workers")  # of those that resume

METHODS = ("formula", "unavailable", "good:level=1/2", "raises")

TELLING_RUN = """
import json, os, sys
from pathlib import Path
sys.path.insert(0, sys.argv[2])
from small_runs import Recorder, carry_out, planned

class Teller(Recorder):
    def tell(self, *what): print(json.dumps(what), flush=True)
    def planned(self, plan, remaining): self.tell("planned", remaining)
    def case_started(self, case, phase): self.tell("phase", case.method, phase)
    def row_finished(self, row): self.tell("row", row.case_key)
    def note(self, text): pass

if __name__ == "__main__":
    carry_out(planned(Path(sys.argv[1]), *sys.argv[3:]), Teller())
"""


def _run_until(results: Path, event: int, how: signal.Signals) -> tuple[list[Any], bool]:
    """Run in a process of its own and end it after an event; return what it told and whether it was ended in time."""
    tests = str(Path(__file__).parent.parent)
    with subprocess.Popen(
        [sys.executable, "-c", TELLING_RUN, str(results), tests, *METHODS], stdout=subprocess.PIPE
    ) as process:
        assert process.stdout is not None
        told = []
        for line in process.stdout:
            told.append(json.loads(line))
            if len(told) == event:
                break
        workers = psutil.Process(process.pid).children(recursive=True) if process.poll() is None else []
        with contextlib.suppress(ProcessLookupError):
            os.kill(process.pid, how)
        told += [json.loads(line) for line in process.stdout if line.endswith(b"\n")]
        process.wait()
    _, alive = psutil.wait_procs(workers, timeout=30)
    assert not alive, "workers die with their runner"
    return told, process.returncode == -how


@pytest.mark.slow
@pytest.mark.parametrize("event", [1, 11, 17, 27])
def test_a_killed_run_loses_no_finished_row_and_resumes_with_exactly_the_rest(tmp_path: Path, event: int) -> None:
    told, was_killed = _run_until(tmp_path, event, signal.SIGKILL)
    assert was_killed
    told_rows = {key for kind, key, *_ in told if kind == "row"}
    with Store.open(tmp_path, create=False) as store:
        (record,) = store.runs()
        kept = store.rows(record.run_id)
    assert record.status is RunStatus.RUNNING
    assert told_rows <= {row.case_key for row in kept}

    resumed = carry_out(planned(tmp_path, *METHODS))
    assert resumed.record.run_id == record.run_id
    assert resumed.record.status is RunStatus.COMPLETE
    assert resumed.seen.remaining == 5 - len(kept)
    assert {row.case_key for row in resumed.seen.rows}.isdisjoint(row.case_key for row in kept)
    assert sorted(row.method for row in resumed.rows) == sorted(m.partition(":")[0] for m in (*METHODS, "good"))
    outcomes = {row.method: row.outcome for row in resumed.rows}
    assert outcomes["raises"] is Outcome.ERROR
    assert outcomes["unavailable"] is Outcome.SKIPPED
    assert outcomes["formula"] is outcomes["good"] is Outcome.OK


@pytest.mark.slow
def test_ctrl_c_keeps_what_is_finished_and_leaves_no_process(tmp_path: Path) -> None:
    told, _ = _run_until(tmp_path, 16, signal.SIGINT)
    with Store.open(tmp_path, create=False) as store:
        (record,) = store.runs()
        assert record.status is RunStatus.INTERRUPTED
        assert {row.case_key for row in store.rows(record.run_id)} == {key for kind, key, *_ in told if kind == "row"}


ENDLESS_WORKER = """
import sys
from pathlib import Path
from shadowbench.runner.pool import Pool
with Pool(tuple(Path(f) for f in sys.argv[1:]), 4 << 30) as pool:
    worker = pool.take(1)
    worker.ask("names", {"kind": "scene"}, 60.0)
    worker.begin("place_scene", {"cache": "nowhere", "scene": {
        "plugin": "endless", "name": "endless", "parameters": {}, "key": "0"}})
    print(worker._process.pid, flush=True)
    worker.end(600.0)
"""


def test_a_worker_in_an_endless_loop_dies_with_its_runner(tmp_path: Path) -> None:
    files = [str(PLUGIN_FILES[0].parent / "scenes_gone_wrong.py")]
    with subprocess.Popen(
        [sys.executable, "-c", ENDLESS_WORKER, *files], stdout=subprocess.PIPE, cwd=tmp_path
    ) as process:
        assert process.stdout is not None
        worker = psutil.Process(int(process.stdout.readline()))
        process.kill()
    _, alive = psutil.wait_procs([worker], timeout=30)
    assert not alive
