"""The workers of a cluster, seen from the client: which there are, and which may measure a plan."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from shadowbench.choices import Choice
from shadowbench.identity import key_of
from shadowbench.runner.cases import Observer, Plan
from shadowbench.runner.cluster.fingerprint import difference, fingerprint, installed_names
from shadowbench.runner.cluster.jobs import RESOURCE
from shadowbench.runner.resolving import MESH_FILE

if TYPE_CHECKING:
    from distributed import Client

_LOOK_S = 0.5
"""Between two looks at who is there."""

_GREET_TIMEOUT_S = 30.0


@dataclass(frozen=True)
class Comrade:
    """A worker that may measure.

    Attributes:
        address: Where dask reaches it.
        name: Unique among all that the scheduler has seen.
        machine: Its machine key.
        host: Its machine's network name.
        code: Digest of what it measures with.
    """

    address: str
    name: str
    machine: str
    host: str
    code: str

    def __str__(self) -> str:
        return f"{self.address} on {self.host}"


class Comrades:
    """Finds workers as they come and go.

    Args:
        client: Connected.
        plan: What they are to measure.
        observer: Told who comes, and who is refused.
    """

    def __init__(self, client: Client, plan: Plan, observer: Observer) -> None:
        self._client, self._observer = client, observer
        cases = [case for case in plan.cases if case.obstacle is None]
        methods = {case.method for case in cases} & installed_names("method")
        scenes = {MESH_FILE if Choice(case.view.scene).is_mesh_file else case.view.scene for case in cases}
        self._wanted = sorted(methods), sorted(scenes & installed_names("scene"))
        self._ours = fingerprint(*self._wanted)
        self._most_threads = max((case.threads for case in cases), default=1)
        self._present: dict[str, Comrade] = {}
        self._looked_at = -_LOOK_S
        self._told_to_wait = False
        self.refused: dict[str, str] = {}

    def look(self) -> None:
        """Find out who is there, unless that was just done."""
        if time.monotonic() - self._looked_at < _LOOK_S:
            return
        self._looked_at = time.monotonic()
        scheduler: Any = self._client.scheduler
        identity = self._client.sync(scheduler.identity, n_workers=-1)
        there = {
            str(info["name"]): address
            for address, info in identity["workers"].items()
            if info["resources"].get(RESOURCE) and info["status"] == "running"
        }
        self._present = {name: comrade for name, comrade in self._present.items() if name in there}
        self.refused = {name: reason for name, reason in self.refused.items() if name in there}
        for name, address in there.items():
            if name not in self._present and name not in self.refused:
                self._meet(name, address)
        if not there and not self._told_to_wait:
            self._observer.note("no worker is there yet: `shadowbench worker` starts one")
        self._told_to_wait = not there

    def __iter__(self) -> Iterator[Comrade]:
        return iter(self._present.values())

    def has(self, comrade: Comrade) -> bool:
        """Return whether a worker is still there."""
        return self._present.get(comrade.name) == comrade or comrade.name in self.refused

    def refuse(self, comrade: Comrade, reason: str) -> None:
        """Give a worker nothing any more."""
        self._present.pop(comrade.name, None)
        self.refused[comrade.name] = f"{comrade} {reason}"
        self._observer.note(f"worker {comrade} {reason}; it gets nothing to measure")

    def _meet(self, name: str, address: str) -> None:
        from shadowbench.runner.cluster.serving import greet

        answers = self._client.run(greet, *self._wanted, workers=[address], on_error="return")
        answer: Any = answers.get(address)
        if answer is None or isinstance(answer, OSError):
            return  # it went away meanwhile
        if isinstance(answer, BaseException):
            self.refuse(Comrade(address, name, "", name, ""), f"cannot be asked what it has: {answer}")
            return
        theirs = answer["fingerprint"]
        comrade = Comrade(address, name, answer["machine"], answer["host"], key_of(theirs))
        differs = difference(self._ours, theirs)
        if differs is not None:
            self.refuse(comrade, differs)
            return
        self._present[name] = comrade
        self._observer.note(f"worker {comrade} joins: {comrade.machine}")
        if answer["cores"] < self._most_threads:
            self._observer.note(f"{self._most_threads} threads share {answer['cores']} cores there")
