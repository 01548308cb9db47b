"""What the machine does and how it is set, read from files that say so."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import pytest

from shadowbench import machine_state
from shadowbench.machine_state import Watch, Watched, warnings_of

TICK = os.sysconf("SC_CLK_TCK")


def _write(root: Path, path: str, text: object) -> None:
    file = root / path
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(f"{text}\n", encoding="ascii")


def test_where_nothing_can_be_read_nothing_is_claimed(tmp_path: Path) -> None:
    assert machine_state.core_quota(tmp_path) is None
    assert machine_state.governors(tmp_path) == []
    assert machine_state.turbo(tmp_path) is None
    assert machine_state.throttle_count(tmp_path) is None
    assert machine_state.memory_bytes(tmp_path) == {}
    assert machine_state.settings(tmp_path).keys() <= {"affinity"}
    assert machine_state.usable_cores(tmp_path) == machine_state.available_cores()
    seen = Watch([], tmp_path).end()
    assert (seen.others, seen.stolen, seen.throttled) == (None, None, 0)
    assert warnings_of(seen, 1, tmp_path) == []


@pytest.mark.parametrize(
    ("files", "quota"),
    [
        ({"proc/self/cgroup": "0::/a/b", "sys/fs/cgroup/a/cpu.max": "150000 100000"}, 1.5),
        ({"proc/self/cgroup": "0::/a/b", "sys/fs/cgroup/a/b/cpu.max": "max 100000"}, None),
        (
            {
                "proc/self/cgroup": "0::/a/b",
                "sys/fs/cgroup/a/b/cpu.max": "200000 100000",
                "sys/fs/cgroup/a/cpu.max": "50000 100000",
            },
            0.5,
        ),
        (
            {
                "proc/self/cgroup": "3:cpu,cpuacct:/c",
                "sys/fs/cgroup/cpu,cpuacct/c/cpu.cfs_quota_us": "250000",
                "sys/fs/cgroup/cpu,cpuacct/c/cpu.cfs_period_us": "100000",
            },
            2.5,
        ),
        (
            {
                "sys/fs/cgroup/cpu/cpu.cfs_quota_us": "-1",
                "sys/fs/cgroup/cpu/cpu.cfs_period_us": "100000",
            },
            None,
        ),
    ],
)
def test_the_quota_is_the_least_of_the_groups_above(files: dict[str, str], quota: float | None, tmp_path: Path) -> None:
    for path, text in files.items():
        _write(tmp_path, path, text)
    assert machine_state.core_quota(tmp_path) == quota
    if quota is not None:
        assert machine_state.usable_cores(tmp_path) == min(quota, machine_state.available_cores())


def test_frequency_and_heat_are_read_from_every_core(tmp_path: Path) -> None:
    for core, governor in enumerate(("powersave", "performance", "powersave")):
        folder = f"sys/devices/system/cpu/cpu{core}"
        _write(tmp_path, f"{folder}/cpufreq/scaling_governor", governor)
        _write(tmp_path, f"{folder}/thermal_throttle/core_throttle_count", core)
    _write(tmp_path, "sys/devices/system/cpu/intel_pstate/no_turbo", 0)
    assert machine_state.governors(tmp_path) == ["performance", "powersave"]
    assert machine_state.throttle_count(tmp_path) == 3
    assert machine_state.turbo(tmp_path) is True
    assert machine_state.settings(tmp_path)["governor"] == ["performance", "powersave"]


def test_amds_boost_is_turbo_too(tmp_path: Path) -> None:
    _write(tmp_path, "sys/devices/system/cpu/cpufreq/boost", 0)
    assert machine_state.turbo(tmp_path) is False


def test_memory_is_in_bytes(tmp_path: Path) -> None:
    _write(tmp_path, "proc/meminfo", "MemTotal:  2048 kB\nMemFree:  1 kB\nMemAvailable:  1024 kB")
    assert machine_state.memory_bytes(tmp_path) == {"total": 2 << 20, "available": 1 << 20}


def _ticks(root: Path, *, busy: int, stolen: int = 0, own: dict[int, int]) -> None:
    _write(root, "proc/stat", f"cpu  {busy - 10} 4 3 1000 50 2 1 {stolen} 0 0\ncpu0 1 1 1 1 1 1 1 1 0 0")
    for process, spent in own.items():
        _write(root, f"proc/{process}/stat", f"{process} (a (b) c) S 1 1 1 0 -1 0 0 0 0 0 {spent - 3} 3 0 0 20 0")


def _watched(root: Path, seconds: float, **after: Any) -> Watched:
    """Watch this process and number 7, from 100 busy ticks on."""
    times = iter((0.0, seconds))
    _ticks(root, busy=100, own={os.getpid(): 10, 7: 20})
    watch = Watch([7], root, clock=lambda: next(times))
    _ticks(root, **after)
    return watch.end()


def test_what_others_use_is_what_all_cores_did_less_our_own(tmp_path: Path) -> None:
    own = {os.getpid(): 10 + TICK, 7: 20 + 2 * TICK}
    seen = _watched(tmp_path, 10.0, busy=100 + 8 * TICK, stolen=TICK, own=own)
    assert seen.others == pytest.approx(0.5)
    assert seen.stolen == pytest.approx(0.1)
    assert seen.record() == {"cores_used_by_others": 0.5, "cores_stolen": 0.1}


def test_a_process_that_is_gone_or_a_moments_watch_tells_nothing_of_others(tmp_path: Path) -> None:
    own = {os.getpid(): 10, 7: 20}
    assert _watched(tmp_path, 0.1, busy=100, own=own).others is None
    times = iter((0.0, 10.0))
    _ticks(tmp_path, busy=100, own=own)
    watch = Watch([7], tmp_path, clock=lambda: next(times))
    (tmp_path / "proc/7/stat").unlink()
    assert watch.end().others is None


def test_watches_add_up_by_their_length() -> None:
    both = Watched(1.0, 1.0, 0.0, 1) + Watched(3.0, 0.0, 0.4, 2)
    assert (both.elapsed_s, both.others, both.stolen, both.throttled) == (4.0, 0.25, pytest.approx(0.3), 3)
    assert Watched() + Watched(2.0, 0.5, 0.25) == Watched(2.0, 0.5, 0.25)


@pytest.mark.parametrize(
    ("seen", "threads", "files", "remedy"),
    [
        (Watched(1.0, others=99.0), 1, {}, "end them"),
        (Watched(1.0, others=0.0, stolen=99.0), 1, {}, "a dedicated machine"),
        (Watched(1.0, throttled=1), 1, {}, "cool the machine"),
        (Watched(), 10_000, {}, "ask for fewer with --threads"),
        (Watched(), 1, {"sys/fs/cgroup/cpu.max": "50000 100000"}, "1 threads share 0.5 cores"),
        (Watched(), 1, {"sys/devices/system/cpu/cpu0/cpufreq/scaling_governor": "ondemand"}, "cpupower"),
    ],
)
def test_every_disturbance_comes_with_its_remedy(
    seen: Watched, threads: int, files: dict[str, str], remedy: str, tmp_path: Path
) -> None:
    for path, text in files.items():
        _write(tmp_path, path, text)
    (found,) = warnings_of(seen, threads, tmp_path)
    assert remedy in found


def test_the_watch_sees_this_machine() -> None:
    assert machine_state.available_cores() >= 1
    assert len(machine_state.load_average()) == 3
    assert Watch([]).end().elapsed_s >= 0.0
