"""What is timed in a block, with all that its rounds gave: cases, and the camera pass."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from shadowbench.rows import Outcome
from shadowbench.runner.cases import Case
from shadowbench.runner.pool import Worker
from shadowbench.runner.protocol import CaseFailure
from shadowbench.runner.rounds import is_tight
from shadowbench.runner.row_making import Timing
from shadowbench.statistics import interval_of


@dataclass(eq=False)
class Member:
    """A case in its worker.

    Attributes:
        case: The case.
        worker: Where it is loaded.
        compile_ms: What its kernels took.
        is_repeat: It has its row, and is timed again as the comparison's baseline.
        timing: Its rounds so far.
        repeats: Of build and of shade within a sample.
        visibility_digest, counters: What the first process gave.
        peak_rss_bytes: The largest of its workers so far.
        warnings: What its processes did not agree about.
    """

    case: Case
    worker: Worker
    compile_ms: float
    is_repeat: bool
    timing: Timing = field(default_factory=Timing)
    repeats: list[int] = field(default_factory=list)
    visibility_digest: str = ""
    counters: dict[str, int] = field(default_factory=dict)
    peak_rss_bytes: int = 0
    warnings: list[str] = field(default_factory=list)

    def add_round(self, answer: dict[str, Any], process: int) -> None:
        self.timing.build.append(answer["build"])
        self.timing.shade.append(answer["shade"])
        self.timing.stages.append(answer["stages"])
        self.timing.processes.append(process)

    def add_warm_up(self, answer: dict[str, Any]) -> None:
        """Take note of a process's first frames.

        Raises:
            CaseFailure: Its result is not the first process's.
        """
        self.timing.warm_up_frames = max(self.timing.warm_up_frames, answer["frames"])
        if not self.repeats:
            self.repeats = answer["repeats"]
            self.visibility_digest, self.counters = answer["visibility_digest"], answer["counters"]
            return
        differing = [
            *(["the visibility"] if answer["visibility_digest"] != self.visibility_digest else []),
            *(["a counter"] if answer["counters"] != self.counters else []),
        ]
        if differing and self.case.deterministic:
            raise CaseFailure(Outcome.INVALID, f"{differing[0]} differs between two worker processes")
        if differing and not self.warnings:
            self.warnings.append("receivers changed between worker processes")

    @property
    def is_tight(self) -> bool:
        return self.timing.is_tight


@dataclass(eq=False)
class CameraMember:
    """The camera pass in its worker."""

    worker: Worker
    durations: list[float] = field(default_factory=list)
    repeats: int | None = None

    def add_round(self, answer: dict[str, Any], process: int) -> None:
        self.durations.append(answer["camera"])

    @property
    def is_tight(self) -> bool:
        return is_tight(interval_of(self.durations))
