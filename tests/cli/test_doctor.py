"""``doctor``: findings, remedies, and its exit status."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from shadowbench.cli import machine_checks, machine_noise
from shadowbench.cli.machine_checks import Check, State
from shadowbench.cli.machine_noise import Noise

Command = Callable[..., Any]


def findings(monkeypatch: pytest.MonkeyPatch, *found: Check) -> None:
    monkeypatch.setattr(machine_checks, "all_checks", lambda results: iter(found))


def test_warnings_leave_the_status_0(command: Command, monkeypatch: pytest.MonkeyPatch) -> None:
    findings(monkeypatch, Check("a", State.OK, "fine"), Check("b", State.WARN, "old", "renew it"))
    ended = command("doctor")
    assert ended.status == 0
    assert "-> renew it" in ended.out
    assert "1 warning" in ended.out


def test_failure_is_status_1(command: Command, monkeypatch: pytest.MonkeyPatch) -> None:
    findings(monkeypatch, Check("a", State.FAIL, "missing", "install it"))
    assert command("doctor").status == 1


def test_check_that_raises_is_a_warning(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    def broken() -> Check:
        raise RuntimeError("no such thing")

    for name in ("versions", "processor", "load", "noise", "frequency", "memory", "warp", "kernel_cache", "graphics"):
        monkeypatch.setattr(machine_checks, name, broken)
    monkeypatch.setattr(machine_checks, "peer", lambda *arguments: broken())
    states = [check.state for check in machine_checks.all_checks(tmp_path)]
    assert State.FAIL not in states
    assert states.count(State.WARN) == 11


def test_missing_package_names_the_command_to_install_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(machine_checks, "library_version", lambda name: None if name == "numpy" else "1.0")
    found = machine_checks.versions()
    assert (found.state, found.remedy) == (State.FAIL, "pip install numpy")


def test_missing_peer_is_a_warning(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(machine_checks, "library_version", lambda name: None)
    found = machine_checks.peer("embreex", "embree", "")
    assert found.state is State.WARN
    assert "shadowbench[peers]" in found.remedy


def test_library_that_takes_its_process_down_is_a_warning(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(machine_checks, "library_version", lambda name: "1.0")
    assert machine_checks.peer("embreex", "embree", "import os; os.abort()").state is State.WARN


def test_results_folder_that_is_a_file_fails(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    assert machine_checks.results_folder(tmp_path / "file").state is State.FAIL
    assert machine_checks.results_folder(tmp_path / "new" / "folder").state is not State.FAIL


def _scattering(rounds: float, processes: float, seed: int = 3) -> Any:
    """Return a sampler whose ratios scatter as said; the drift is common to both sides."""

    def sample(process_count: int, round_count: int) -> tuple[list[float], list[float], list[int]]:
        rng = np.random.default_rng(seed)
        numbers = np.repeat(np.arange(process_count), round_count)
        drift = np.linspace(5.0, 9.0, len(numbers))
        logs = rng.normal(0.0, processes, process_count)[numbers] + rng.normal(0.0, rounds, len(numbers))
        return list(drift * np.exp(logs)), list(drift), [int(number) for number in numbers]

    return sample


def test_noise_of_rounds_and_of_processes_are_told_apart() -> None:
    found = [machine_noise.measured_noise(_scattering(0.02, 0.01, seed)) for seed in range(60)]
    assert np.median([noise.of_rounds for noise in found]) == pytest.approx(0.02, rel=0.1)
    assert np.mean([noise.of_processes**2 for noise in found]) ** 0.5 == pytest.approx(0.01, rel=0.2)
    quiet = machine_noise.measured_noise(_scattering(0.0, 0.0))
    assert (quiet.of_rounds, quiet.of_processes) == pytest.approx((0.0, 0.0), abs=1e-12)


def test_the_smallest_difference_and_the_rounds_for_it_are_each_others_inverse() -> None:
    noise = Noise(0.02, 0.004)
    for rounds in (10, 30, 200):
        assert noise.rounds_for(noise.smallest_difference(rounds, 5), 5) in (rounds, rounds + 1)
    assert noise.smallest_difference(1000, 5) < noise.smallest_difference(30, 5) < noise.smallest_difference(30, 3)
    # t with 4 degrees of freedom times the standard error of the processes alone
    assert noise.smallest_difference(10**9, 5) == pytest.approx(math.expm1(2.776 * 0.004 / math.sqrt(5)), rel=1e-3)
    assert noise.rounds_for(0.001, 5) is None


def test_doctor_says_what_to_expect_of_a_quiet_machine_and_warns_of_a_noisy_one() -> None:
    quiet = machine_checks.noise(_scattering(0.01, 0.002))
    assert quiet.state is State.OK
    assert "30 rounds in 5 processes show differences from about" in quiet.found
    noisy = machine_checks.noise(_scattering(0.3, 0.1))
    assert noisy.state is State.WARN
    assert "end other programs" in noisy.remedy


def test_the_calculation_is_timed_in_turn_in_fresh_processes() -> None:
    first, second, processes = machine_noise.take_samples(2, 3)
    assert processes == [0, 0, 0, 1, 1, 1]
    assert len(first) == len(second) == 6
    assert min(first + second) > 0.0


def test_a_governor_that_follows_the_load_is_a_warning(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(machine_checks, "governors", lambda: ["powersave"])
    monkeypatch.setattr(machine_checks, "turbo", lambda: True)
    monkeypatch.setattr(machine_checks, "throttle_count", lambda: 3)
    found = machine_checks.frequency()
    assert found.state is State.WARN
    assert found.found == "governor powersave, turbo on, slowed down for heat 3 times since the start"
    assert "cpupower" in found.remedy
    monkeypatch.setattr(machine_checks, "governors", list)
    assert machine_checks.frequency().state is State.OK
