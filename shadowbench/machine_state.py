"""What the machine is doing and how it is set: load, other programs, frequency scaling, throttling, cores allowed.

Read from ``/proc`` and ``/sys`` where there are such (Linux); what cannot be read is ``None`` or empty, never a guess.
Nothing here changes anything, or imports Warp.
"""

from __future__ import annotations

import math
import os
import time
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

ROOT = Path("/")

_BUSY = (0, 1, 2, 5, 6)
"""Of /proc/stat's fields: user, nice, system, interrupts; 3 and 4 are idle, 7 is stolen by the hypervisor."""

_STOLEN = 7

NOTICEABLE = 0.05
"""Share of the cores that others may use before a row says so."""

_SHORTEST_WATCH_S = 0.5
"""The system counts in hundredths of a second; shares of less time are rounding."""


def available_cores() -> int:
    """Return how many cores this process may run on."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def affinity() -> list[int]:
    """Return the cores that this process may run on, by number; empty where the system does not say."""
    return sorted(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else []


def core_quota(root: Path = ROOT) -> float | None:
    """Return how many cores' time the control group grants, or ``None`` for no limit."""
    limits = []
    for group in _control_groups(root):
        text = _text(group / "cpu.max").split()
        if len(text) == 2 and text[0] != "max":
            limits.append(float(text[0]) / float(text[1]))
        quota, period = (_whole(group / f"cpu.cfs_{name}_us") for name in ("quota", "period"))
        if quota is not None and quota > 0 and period:
            limits.append(quota / period)
    return min(limits, default=None)


def usable_cores(root: Path = ROOT) -> float:
    """Return how many cores' time this process can get: what its affinity and its control group leave."""
    quota = core_quota(root)
    return float(available_cores()) if quota is None else min(float(available_cores()), quota)


def governors(root: Path = ROOT) -> list[str]:
    """Return the frequency governors of the cores, each once; empty where none is visible (a virtual machine, say)."""
    files = sorted(root.glob("sys/devices/system/cpu/cpu[0-9]*/cpufreq/scaling_governor"))
    return sorted({text for file in files if (text := _text(file))})


def turbo(root: Path = ROOT) -> bool | None:
    """Return whether cores may exceed their nominal frequency while they are cool; ``None`` if that is not visible."""
    folder = root / "sys/devices/system/cpu"
    without = _whole(folder / "intel_pstate/no_turbo")
    if without is not None:
        return without == 0
    boost = _whole(folder / "cpufreq/boost")
    return None if boost is None else boost == 1


def throttle_count(root: Path = ROOT) -> int | None:
    """Return how often a core has been slowed down since it was too hot; ``None`` if that is not counted."""
    files = root.glob("sys/devices/system/cpu/cpu[0-9]*/thermal_throttle/core_throttle_count")
    counts = [count for file in files if (count := _whole(file)) is not None]
    return sum(counts) if counts else None


def memory_bytes(root: Path = ROOT) -> dict[str, int]:
    """Return ``total`` and ``available`` main memory."""
    found = {}
    for line in _text(root / "proc/meminfo").splitlines():
        name, _, value = line.partition(":")
        if name in ("MemTotal", "MemAvailable") and value.split():
            found[{"MemTotal": "total", "MemAvailable": "available"}[name]] = int(value.split()[0]) * 1024
    return found


def load_average() -> list[float]:
    """Return the number of programs that ran or waited to, over the last 1, 5 and 15 minutes."""
    return [round(load, 2) for load in os.getloadavg()]


def settings(root: Path = ROOT) -> dict[str, Any]:
    """Return how the machine is set, for the record of a run; only what is known."""
    found = {
        "affinity": affinity(),
        "core_quota": core_quota(root),
        "governor": governors(root),
        "turbo": turbo(root),
        "memory_gib": {name: round(size / 2**30, 2) for name, size in memory_bytes(root).items()},
    }
    return {name: value for name, value in found.items() if value not in (None, [], {})}


@dataclass(frozen=True)
class Watched:
    """What went on while something was watched.

    Attributes:
        elapsed_s: How long it took [s].
        others: Cores that other programs kept busy, on average; ``None`` if unknown.
        stolen: Cores that the hypervisor gave to others while they were wanted here.
        throttled: How often a core was slowed down for heat.
    """

    elapsed_s: float = 0.0
    others: float | None = None
    stolen: float | None = None
    throttled: int = 0

    def __add__(self, later: Watched) -> Watched:
        """Return both times together."""
        total = self.elapsed_s + later.elapsed_s
        return Watched(
            total,
            _mean(self.others, self.elapsed_s, later.others, later.elapsed_s),
            _mean(self.stolen, self.elapsed_s, later.stolen, later.elapsed_s),
            self.throttled + later.throttled,
        )

    def record(self) -> dict[str, Any]:
        """Return what is known, for the environment of a row."""
        found = {"cores_used_by_others": self.others, "cores_stolen": self.stolen}
        return {name: round(value, 2) for name, value in found.items() if value is not None}


class Watch:
    """Watches the machine from its making to :meth:`end`.

    Args:
        processes: Ids of the processes whose work is our own, beside this one. They must live until the end.
        root: Where ``proc`` and ``sys`` lie.
        clock: Seconds.
    """

    def __init__(self, processes: Iterable[int], root: Path = ROOT, clock: Any = time.monotonic) -> None:
        self._root, self._clock = root, clock
        self._processes = [os.getpid(), *processes]
        self._begin = self._look()

    def end(self) -> Watched:
        """Return what went on."""
        then, busy_then, stolen_then, own_then, throttled_then = self._begin
        now, busy, stolen, own, throttled = self._look()
        elapsed = now - then
        throttles = max(0, (throttled or 0) - (throttled_then or 0))
        if elapsed < _SHORTEST_WATCH_S or math.isnan(busy - busy_then):
            return Watched(elapsed, throttled=throttles)
        others = None if math.isnan(own) else max(0.0, (busy - busy_then) - (own - own_then)) / elapsed
        return Watched(elapsed, others, (stolen - stolen_then) / elapsed, throttles)

    def _look(self) -> tuple[float, float, float, float, int | None]:
        """Return time, busy and stolen time of all cores, our own time [s], and the throttle count."""
        tick = float(os.sysconf("SC_CLK_TCK"))
        fields = _text(self._root / "proc/stat").partition("\n")[0].split()[1:]
        counts = [int(field) for field in fields] if len(fields) > _STOLEN else []
        busy = sum(counts[place] for place in _BUSY) / tick if counts else math.nan
        stolen = counts[_STOLEN] / tick if counts else math.nan
        own = sum(_process_ticks(self._root / f"proc/{process}/stat") for process in self._processes) / tick
        return self._clock(), busy, stolen, own, throttle_count(self._root)


def warnings_of(seen: Watched, threads: int, root: Path = ROOT) -> list[str]:
    """Return what disturbs a measurement, each with its remedy; without figures, so that notes stay few.

    Args:
        seen: What went on during the rounds.
        threads: That the case may use.
        root: Where ``proc`` and ``sys`` lie.
    """
    cores, found = usable_cores(root), []
    if seen.others is not None and seen.others > NOTICEABLE * available_cores():
        found.append("other programs were at work during the rounds; end them, or measure when the machine is quiet")
    if seen.stolen is not None and seen.stolen > NOTICEABLE * available_cores():
        found.append("the hypervisor gave this machine's cores to others; a dedicated machine measures better")
    if threads > cores:
        found.append(f"{threads} threads share {cores:g} cores; ask for fewer with --threads, or allow it more cores")
    if any(governor != "performance" for governor in governors(root)):
        found.append("cores change their frequency with the load; `cpupower frequency-set -g performance` holds it")
    if seen.throttled:
        found.append("cores were slowed down for heat; cool the machine, or switch turbo off so that it stays cooler")
    return found


def _control_groups(root: Path) -> list[Path]:
    """Return the folders that may limit this process's time: of its own group and the groups above."""
    base = root / "sys/fs/cgroup"
    own = [base, base / "cpu", base / "cpu,cpuacct"]
    for line in _text(root / "proc/self/cgroup").splitlines():
        _, _, rest = line.partition(":")
        controllers, _, path = rest.partition(":")
        if controllers == "" or "cpu" in controllers.split(","):
            folder = base if controllers == "" else base / controllers
            parts = [part for part in path.split("/") if part and part != ".."]
            own += [folder.joinpath(*parts[:count]) for count in range(1, len(parts) + 1)]
    return own


def _process_ticks(file: Path) -> float:
    """Return the user and system time of a process and of its children that have ended; NaN if it is gone."""
    fields = _text(file).rpartition(")")[2].split()  # the name before may hold anything
    return float(sum(int(field) for field in fields[11:15])) if len(fields) > 14 else math.nan


def _mean(one: float | None, one_weight: float, other: float | None, other_weight: float) -> float | None:
    if one is None or other is None:
        return other if one is None else one
    return (one * one_weight + other * other_weight) / max(one_weight + other_weight, 1.0e-9)


def _text(file: Path) -> str:
    try:
        return file.read_text(encoding="utf-8", errors="replace").strip()
    except OSError:
        return ""


def _whole(file: Path) -> int | None:
    text = _text(file)
    return int(text) if text.lstrip("-").isdigit() else None
