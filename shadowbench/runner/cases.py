"""What the runner works on: options, cases, plans, and whom it tells.

A plan is made once (:mod:`shadowbench.runner.planning`) and says everything that can be known before measuring; running
it adds nothing but rows. Only plain values are kept here, so that the command line can print a plan and the runner
can hand a case to a worker process.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from shadowbench.choices import EVERYTHING
from shadowbench.rows import Outcome, ResultRow

if TYPE_CHECKING:
    from shadowbench.experiment import Experiment


@dataclass(frozen=True)
class RunOptions:
    """How to run, apart from what.

    Attributes:
        results: The results folder; the cache of scenes and references lies in it.
        device: Warp device.
        threads: Numbers of threads for comparisons that do not say; empty for all available cores.
        timeout_s: Longest that one step of a case may take: loading, warming up, one round, or measuring [s].
        budget_s: Time for the rounds of one comparison; no round begins after it. Loading its cases again in fresh
            processes may take as long once more, and 12 s in any case. ``None`` for the experiment's own or else 30 s.
        memory_limit_bytes: Resident size at which a worker is stopped; ``None`` for the smaller of 8 GiB and 60 % of
            the machine's memory.
        min_rounds: Rounds before a comparison may end because its intervals are tight; from 6 on a median has a
            95 % interval.
        max_rounds: Rounds after which a comparison ends.
        processes: Worker processes that the rounds of a case are divided among, where the budget allows at least three.
        fresh: Measure again what an earlier run of the same plan has finished, and take no quality over.
        plugin_files: Files given with ``--plugin``.
        argv: The command line, for the record.
    """

    results: Path = Path("shadowbench-results")
    device: str = "cpu"
    threads: tuple[int, ...] = ()
    timeout_s: float = 300.0
    budget_s: float | None = None
    memory_limit_bytes: int | None = None
    min_rounds: int = 6
    max_rounds: int = 30
    processes: int = 5
    fresh: bool = False
    plugin_files: tuple[Path, ...] = ()
    argv: tuple[str, ...] = ()

    @property
    def cache(self) -> Path:
        """Where worlds, receivers and references are kept; absolute, since a plugin may change its folder."""
        return self.results.absolute() / "cache"


@dataclass(frozen=True)
class Obstacle:
    """Why a case ends before it begins: its row, known when the plan is made."""

    outcome: Outcome
    reason: str
    stderr_tail: str = ""


@dataclass(frozen=True)
class View:
    """What a comparison's cases have in common: one placed scene under one light, seen by one camera.

    Attributes:
        scene: The plugin's name, or a mesh file's name.
        scene_parameters: All parameters, defaults included.
        world_key: Names the placed scene in the cache; empty if the scene could not be made.
        content: Digest of the placed scene, empty likewise.
        triangles: Of the placed scene, over all instances.
        light, camera: Names that the scene has.
        width, height: Size of the picture [pixels].
        pixel_samples: Samples of every pixel.
        layers: Most surfaces that a sample sees.
        moving: What moves between two frames.
        notes: The scene's warnings.
    """

    scene: str
    scene_parameters: dict[str, Any]
    world_key: str
    content: str
    triangles: int | None
    light: str
    camera: str
    width: int
    height: int
    pixel_samples: int = 1
    layers: int = 1
    moving: str = EVERYTHING
    notes: tuple[str, ...] = ()

    def __str__(self) -> str:
        text = f"{self.scene}, light '{self.light}', camera '{self.camera}', {self.width}x{self.height}"
        text += f", {self.pixel_samples} samples a pixel" if self.pixel_samples > 1 else ""
        text += f", {self.layers} layers" if self.layers > 1 else ""
        return text + (f", moving {self.moving}" if self.moving != EVERYTHING else "")


@dataclass(frozen=True)
class Case:
    """One scene x light x view x method configuration x device x threads.

    Attributes:
        experiment: Name of the experiment it belongs to.
        comparison: Index into :attr:`Plan.comparisons`.
        view: Scene, light, camera and size.
        method, method_title: The method's name and full name.
        method_parameters: All parameters, defaults included.
        deterministic: As the method declares.
        device, threads: Where it runs.
        quality_key, case_key: What pixels, and what times depend on.
        libraries: Versions of what the method depends on beside Warp, by name; a peer's own, and its device.
        obstacle: Why it cannot be measured, if that is known already.
    """

    experiment: str
    comparison: int
    view: View
    method: str
    method_title: str
    method_parameters: dict[str, Any]
    deterministic: bool
    device: str
    threads: int
    quality_key: str
    case_key: str
    libraries: dict[str, str] = field(default_factory=dict)
    obstacle: Obstacle | None = None


@dataclass(frozen=True)
class Plan:
    """All that a run will do.

    Attributes:
        experiments: What was asked for.
        options: How.
        comparisons: Cases by comparison: those that are timed in the same rounds.
        plan_key: Hash of all case keys; equal for a run that would measure the same.
        notes: What the user should know before it begins.
        method_defaults: Method to parameter to default, so that tables can leave defaults out.
        warp: The device, and how Warp compiles for it, for the record.
    """

    experiments: tuple[Experiment, ...]
    options: RunOptions
    comparisons: tuple[tuple[Case, ...], ...]
    plan_key: str
    notes: tuple[str, ...] = ()
    method_defaults: dict[str, dict[str, Any]] = field(default_factory=dict)
    warp: dict[str, Any] = field(default_factory=dict)

    @property
    def cases(self) -> tuple[Case, ...]:
        """All cases, in the order in which they run."""
        return tuple(case for comparison in self.comparisons for case in comparison)


class Observer(Protocol):
    """Who is told what happens while a run goes on."""

    def planned(self, plan: Plan, remaining: int) -> None:
        """Tell that the run begins, and how many of its cases have no row yet."""

    def case_started(self, case: Case, phase: str) -> None:
        """Tell that a step of a case begins: ``load``, ``warm up``, ``round 3``, ``filter the truth`` or ``measure``.

        The first case of a comparison also stands for what is done for all: ``compile`` and ``prepare``.
        """

    def row_finished(self, row: ResultRow) -> None:
        """Tell that a case has ended and its row is kept."""

    def note(self, text: str) -> None:
        """Tell something about the run as a whole."""


class SilentObserver:
    """Tells nobody."""

    def planned(self, plan: Plan, remaining: int) -> None:
        """See :class:`Observer`."""

    def case_started(self, case: Case, phase: str) -> None:
        """See :class:`Observer`."""

    def row_finished(self, row: ResultRow) -> None:
        """See :class:`Observer`."""

    def note(self, text: str) -> None:
        """See :class:`Observer`."""
