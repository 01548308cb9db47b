"""A run on a cluster of this machine that is killed again and again, and what is left of it.

At seeded random moments the client, a dask worker, a measuring process or a case's process is ended by SIGKILL; clients
and dask workers are started again. When the run is complete, every case has one row, no row that was told as finished
is lost or changed, the database is whole, and no client measured what had a row. Cases whose own process was killed say
so: they are crashes.

    python tests/benchmarks/cluster_kills.py [KILLS] [SEED]
"""

from __future__ import annotations

import contextlib
import os
import random
import signal
import sqlite3
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent.parent))

from clusters import BENCH, CASE, LocalCluster, running_below
from small_runs import planned

from shadowbench.rows import Outcome, RunStatus
from shadowbench.store import Store

VICTIMS = ("client", "dask worker", "measuring process", "case process")
SCENES = ("tiny:ground=2", "tiny:ground=3", "tiny:ground=4", "tiny:ground=5")
METHODS = ("formula", "good:level=1", "slow:seconds=0.02")

CLIENT = """
import sys
from pathlib import Path
sys.path.insert(0, sys.argv[1])
from small_runs import Recorder, carry_out, planned
from shadowbench.runner.cases import ClusterAccess

class Teller(Recorder):
    def planned(self, plan, remaining): print("left", remaining, flush=True)
    def case_started(self, case, phase): print("phase", flush=True)
    def row_finished(self, row): print("row", row.case_key, flush=True)

scenes = tuple(sys.argv[4].split())
carry_out(planned(Path(sys.argv[2]), *sys.argv[5:], scenes=scenes, cluster=ClusterAccess(sys.argv[3])), Teller())
"""


@dataclass
class Counts:
    """What happened."""

    kills: Counter[str] = field(default_factory=Counter)
    clients: int = 0
    cases: int = 0
    crashes: int = 0
    wrong: list[str] = field(default_factory=list)


def killed_run(folder: Path, kills: int, seed: int, scenes: Sequence[str] = SCENES) -> Counts:
    """Carry out runs, one after the other, until all kills were made and the last run is complete."""
    chance, counts, number = random.Random(seed), Counts(), 0
    with LocalCluster(folder / "cluster") as cluster:
        while sum(counts.kills.values()) < kills:
            number += 1
            _one_run(folder / f"run-{number}", cluster, scenes, kills, chance, counts)
    return counts


def _one_run(
    results: Path, cluster: LocalCluster, scenes: Sequence[str], kills: int, chance: random.Random, counts: Counts
) -> None:
    told: set[str] = set()
    is_complete = False
    while not is_complete:
        counts.clients += 1
        before = _kept(results)
        moment = chance.randrange(3, 30) if sum(counts.kills.values()) < kills else None
        while len(cluster.workers) < 2:
            cluster.worker()
        command = [sys.executable, "-c", CLIENT, str(Path(__file__).parent.parent)]
        arguments = [str(results), cluster.address, " ".join(scenes), *METHODS]
        with subprocess.Popen([*command, *arguments], stdout=subprocess.PIPE, text=True) as client:
            assert client.stdout is not None
            for event, line in enumerate(client.stdout):
                words = line.split()
                if words[0] == "left" and int(words[1]) != len(scenes) * len(METHODS) - len(before):
                    counts.wrong.append(f"a client had {words[1]} cases left after {len(before)} rows")
                if words[0] == "row" and line.endswith("\n"):
                    if words[1] in before:
                        counts.wrong.append(f"{words[1]} was measured again")
                    told.add(words[1])
                if event == moment:
                    moment = event + chance.randrange(3, 30) if sum(counts.kills.values()) + 1 < kills else None
                    _kill_someone(client, cluster, chance, counts)
        is_complete = client.returncode == 0
        if client.returncode not in (0, -signal.SIGKILL):
            counts.wrong.append(f"a client ended with {client.returncode}")
            return
        counts.wrong += [f"{key} was lost" for key in told - _kept(results).keys()]
        changed = [key for key, row in _kept(results).items() if before.get(key, row) != row]
        counts.wrong += [f"{key} was changed" for key in changed]
    _look_at(results, scenes, counts)


def _kill_someone(client: subprocess.Popen[str], cluster: LocalCluster, chance: random.Random, counts: Counts) -> None:
    victim = chance.choice(VICTIMS)
    worker = chance.choice(cluster.workers)
    if victim == "client":
        client.kill()
    elif victim == "dask worker":
        worker.kill()
        worker.wait()
        cluster.worker()
    else:
        bench = victim == "measuring process"
        module = BENCH if bench else CASE
        below = [process for each in cluster.workers for process in running_below(each, module)]
        if not below:
            return
        with contextlib.suppress(ProcessLookupError):
            os.kill(chance.choice(below).pid, signal.SIGKILL)
    counts.kills[victim] += 1


def _kept(results: Path) -> dict[str, str]:
    """Return the rows in the store, as text, by case."""
    if not results.exists():
        return {}
    with Store.open(results) as store:
        rows = [row for run in store.runs() for row in store.rows(run.run_id)]
    found = {row.case_key: row.model_dump_json() for row in rows}
    assert len(found) == len(rows), "a case has two rows"
    return found


def _look_at(results: Path, scenes: Sequence[str], counts: Counts) -> None:
    with sqlite3.connect(results / "results.sqlite") as database:
        ((integrity,),) = database.execute("PRAGMA integrity_check")
    with Store.open(results) as store:
        runs = store.runs()
        rows = store.rows(runs[0].run_id)
    planned_keys = {case.case_key for case in planned(results, *METHODS, scenes=tuple(scenes)).cases}
    if integrity != "ok":
        counts.wrong.append(f"the database: {integrity}")
    if len(runs) != 1 or runs[0].status is not RunStatus.COMPLETE:
        counts.wrong.append(f"{len(runs)} runs, the last {runs[0].status}")
    if {row.case_key for row in rows} != planned_keys or len(rows) != len(planned_keys):
        counts.wrong.append(f"{len(rows)} rows of {len(planned_keys)} cases")
    counts.cases += len(rows)
    counts.crashes += sum(row.outcome is Outcome.CRASH for row in rows)
    counts.wrong += [f"{row.method}: {row.outcome} {row.reason}" for row in rows if row.outcome not in _EXPECTED]


_EXPECTED = (Outcome.OK, Outcome.CRASH)


if __name__ == "__main__":
    with tempfile.TemporaryDirectory(prefix="shadowbench-kills-") as name:
        counted = killed_run(Path(name), *map(int, (sys.argv[1:] + ["30", "1"][len(sys.argv) - 1 :])[:2]))
    print(f"{sum(counted.kills.values())} kills: {dict(counted.kills)}; {counted.clients} clients")
    print(f"{counted.cases} cases, {counted.crashes} of them crashes by a kill")
    print("\n".join(counted.wrong) or "nothing lost, nothing doubled, nothing measured twice, the database whole")
    sys.exit(bool(counted.wrong))
