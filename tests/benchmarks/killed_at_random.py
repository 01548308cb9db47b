"""``kill -9`` at random moments of real runs: of the client, and of a worker process.

    python tests/benchmarks/killed_at_random.py [moments] [seed] [client|worker]

Each moment is drawn from the time that an undisturbed run takes, from its start to its end. A killed *client* must
leave no process; every row that it had told of must be in the database, whole, with its pictures; the same command
again must measure exactly the rest and change no row. A killed *worker* must cost its own case at most, and the run
must end by itself with one row a case. The database's integrity is checked after every kill. Prints one line a moment
and the counts; ends with status 1 if anything was lost, doubled or damaged.
"""

from __future__ import annotations

import json
import random
import signal
import sqlite3
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Sequence
from contextlib import closing, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import psutil

from shadowbench.rows import Outcome, ResultRow, RunStatus
from shadowbench.store import DATABASE_NAME, Store

METHODS = ("no-shadows", "shadow-map:resolution=64/128", "pcf:resolution=64")
CASE_COUNT = 4

RUN = """
import sys
from pathlib import Path
from shadowbench import experiment, runner
from shadowbench.runner.cases import SilentObserver
from shadowbench.store import Store

class Teller(SilentObserver):
    def row_finished(self, row):
        print(row.model_dump_json(), flush=True)

if __name__ == "__main__":
    asked = experiment.from_options(scenes=["box-on-plane"], methods=sys.argv[2:], sizes=["64x48"])
    options = runner.RunOptions(
        results=Path(sys.argv[1]), threads=(1,), budget_s=2.0, min_rounds=4, max_rounds=6, processes=1
    )
    plan = runner.plan([asked], options)
    with Store.open(options.results) as store:
        record = runner.run(plan, store, Teller())
        sys.exit(sum(row.outcome.is_failure for row in store.rows(record.run_id)))
"""
"""What ``shadowbench run`` does, with few rounds."""


@dataclass
class Client:
    """A run in a process of its own."""

    results: Path
    process: subprocess.Popen[bytes] = field(init=False)

    def __post_init__(self) -> None:
        self.process = subprocess.Popen(
            [sys.executable, "-P", "-c", RUN, str(self.results), *METHODS],
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
        )

    def children(self) -> list[psutil.Process]:
        with suppress(psutil.Error):
            return psutil.Process(self.process.pid).children(recursive=True)
        return []

    def told(self) -> list[dict[str, Any]]:
        """Return the rows that it told of until it ended; the last line may be cut short."""
        told, _ = self.process.communicate()
        return [json.loads(line) for line in told.split(b"\n")[:-1]]


def kept(results: Path) -> tuple[list[ResultRow], RunStatus | None]:
    """Return the rows and the status of the one run there is, checking the database and every picture."""
    if not (results / DATABASE_NAME).exists():
        return [], None
    with closing(sqlite3.connect(results / DATABASE_NAME)) as connection:
        found = connection.execute("PRAGMA integrity_check").fetchall()
        assert found == [("ok",)], f"integrity: {found}"
    with Store.open(results) as store:
        runs = store.runs()
        assert len(runs) <= 1, f"{len(runs)} runs"
        rows = [row for run in runs for row in store.rows(run.run_id)]
        for row in rows:
            for name in row.artifacts.values():
                store.artifact(name)
            if row.outcome is Outcome.OK:
                assert row.samples["shade"], "a row without its samples"
                assert row.counters is not None
        return rows, runs[0].status if runs else None


def kill_client(results: Path, after_s: float) -> str:
    """Kill the client, go on with its run, and return what happened."""
    client = Client(results)
    time.sleep(after_s)
    workers = client.children()
    was_alive = client.process.poll() is None
    client.process.send_signal(signal.SIGKILL)
    told = {row["case_key"] for row in client.told()}
    _, alive = psutil.wait_procs(workers, timeout=30)
    assert not alive, f"{len(alive)} processes outlived their client"
    before, _ = kept(results)
    assert told <= {row.case_key for row in before}, "a row that was told of is lost"
    resumed = Client(results)
    measured = {row["case_key"] for row in resumed.told()}
    after, status = kept(results)
    assert resumed.process.returncode == 0, f"going on ended with status {resumed.process.returncode}"
    assert status is RunStatus.COMPLETE
    assert len(after) == CASE_COUNT == len({row.case_key for row in after}), f"{len(after)} rows"
    assert {row.case_key: row for row in after}.items() >= {row.case_key: row for row in before}.items(), "changed rows"
    assert measured == {row.case_key for row in after} - {row.case_key for row in before}, "not exactly the rest"
    return f"{len(before)} rows kept, {CASE_COUNT - len(before)} measured later" if was_alive else "it had ended"


def kill_worker(results: Path, after_s: float, choice: random.Random) -> str:
    """Kill one of the workers, if there is one, and return what became of the run."""
    client = Client(results)
    time.sleep(after_s)
    workers = [child for child in client.children() if _is_worker(child)]
    victim = choice.choice(workers) if workers else None
    if victim is not None:
        with suppress(psutil.Error):
            victim.send_signal(signal.SIGKILL)
    client.told()
    rows, status = kept(results)
    if victim is None:
        assert client.process.returncode == 0
        return "no worker at that moment"
    failed = [row for row in rows if row.outcome is not Outcome.OK]
    assert status is RunStatus.COMPLETE, f"the run is {status}, exit status {client.process.returncode}"
    assert len(rows) == CASE_COUNT == len({row.case_key for row in rows}), f"{len(rows)} rows"
    assert len(failed) <= 1, [row.reason for row in failed]
    assert all(row.outcome is Outcome.CRASH and "SIGKILL" in row.reason for row in failed)
    assert client.process.returncode == len(failed)
    Client(results).told()
    assert kept(results)[0] == rows, "running again changed a complete run"
    return f"its case ended: {failed[0].reason.partition(' during ')[2]}" if failed else "no case was lost"


def _is_worker(process: psutil.Process) -> bool:
    with suppress(psutil.Error):
        return "shadowbench.runner.worker" in process.cmdline()
    return False


def main(moments: int, seed: int, victims: Sequence[str]) -> int:
    choice = random.Random(seed)
    broken = 0
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        begin = time.monotonic()
        Client(folder / "warm").told()  # compiles kernels
        begin = time.monotonic()
        undisturbed = Client(folder / "undisturbed")
        undisturbed.told()
        assert undisturbed.process.returncode == 0
        duration_s = time.monotonic() - begin
        print(f"an undisturbed run of {CASE_COUNT} cases takes {duration_s:.1f} s; {moments} moments each, seed {seed}")
        for what in victims:
            counts = Counter[str]()
            for number in range(moments):
                after_s = choice.uniform(0.0, duration_s)
                results = folder / f"{what}-{number}"
                try:
                    said = kill_client(results, after_s) if what == "client" else kill_worker(results, after_s, choice)
                except (AssertionError, ValueError) as error:
                    broken += 1
                    said = f"BROKEN: {error}"
                counts[said] += 1
                print(f"{what} {number + 1:>2} after {after_s:5.2f} s: {said}", flush=True)
            print(f"{what}:", ", ".join(f"{count} x {said}" for said, count in counts.most_common()), flush=True)
    print(f"{broken} broken")
    return 1 if broken else 0


if __name__ == "__main__":
    given = [int(argument) for argument in sys.argv[1:3]]
    sys.exit(main(*(given + [30, 1][len(given) :]), sys.argv[3:] or ("client", "worker")))
