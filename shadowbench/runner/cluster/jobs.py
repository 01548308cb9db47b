"""What the client and a worker say to each other.

A job travels as one pickled value that only the measuring process opens, since the dask worker may have been started
before the code was last changed. What comes back is plain values: phases and rows through a dask queue while the job
goes on, and how it ended as the dask task's result.
"""

from __future__ import annotations

import pickle
from dataclasses import dataclass
from typing import Any, Literal, TypedDict

from shadowbench.rows import RunRecord
from shadowbench.runner.cases import Case, RunOptions

RESOURCE = "shadowbench"
"""The dask resource of which each worker has one, and each job takes one."""

PLUGIN_NAME = "shadowbench"


@dataclass(frozen=True)
class PluginFile:
    """A ``--plugin`` file, sent along: its name and its content."""

    name: str
    content: bytes


@dataclass(frozen=True)
class Job:
    """What is left of a comparison, or a part of it.

    Attributes:
        name: Unique in its run.
        record: The run's.
        options: The run's; folder and plugin files are replaced where it is measured.
        cases: To measure.
        baseline: As for :func:`shadowbench.runner.comparison.measure_comparison`.
        budget_s: Likewise.
        plugin_files: The run's.
    """

    name: str
    record: RunRecord
    options: RunOptions
    cases: tuple[Case, ...]
    baseline: Case | None
    budget_s: float
    plugin_files: tuple[PluginFile, ...] = ()


class Message(TypedDict, total=False):
    """Something about a case of a job: ``phase``, ``row`` (with its ``pictures``) or a ``note``.

    ``index`` is the case's place in the job; ``row`` is JSON; ``pictures`` are file contents by name in the store.
    """

    kind: Literal["phase", "row", "note"]
    job: str
    index: int
    text: str
    row: str
    pictures: dict[str, bytes]


@dataclass(frozen=True)
class Ending:
    """How a job ended.

    Attributes:
        how: ``done``; ``died``: the measuring process was killed, or left; ``refused``: this machine must not measure
            it; ``failed``: it cannot.
        reason: One line, if it is not done.
    """

    how: Literal["done", "died", "refused", "failed"]
    reason: str = ""

    def to_wire(self) -> dict[str, str]:
        """Return plain values."""
        return {"how": self.how, "reason": self.reason}

    @classmethod
    def from_wire(cls, values: Any) -> Ending:
        """Read what :meth:`to_wire` wrote."""
        return cls(values["how"], str(values["reason"]))


def packed(job: Job) -> bytes:
    """Return a job as bytes."""
    return pickle.dumps(job, protocol=5)


def unpacked(content: bytes) -> Job:
    """Return the job of :func:`packed`."""
    job = pickle.loads(content)
    assert isinstance(job, Job)
    return job
