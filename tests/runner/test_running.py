"""Running plans of methods that behave: rows, resuming, and who may run."""

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from small_runs import PLUGIN_FILES, PLUGINS, Ended, Recorder, carry_out, planned

from shadowbench.errors import StoreError, UsageError
from shadowbench.rows import Outcome, RunStatus
from shadowbench.store import Store

Measure = Callable[..., Ended]

pytestmark = pytest.mark.usefixtures("lasting_workers")


def test_a_row_says_what_was_measured(measure: Measure, tmp_path: Path) -> None:
    ended = measure("formula", "formula:shift=0.25", "good", sizes=["96x64"], max_rounds=8, min_rounds=8)
    assert ended.record.status is RunStatus.COMPLETE
    assert [row.outcome for row in ended.rows] == [Outcome.OK] * 3
    exact, shifted, lit = ended.rows

    # the formula is right, so whatever it gets wrong lies on the shadow's outline
    assert exact.failure_count == 0
    assert exact.scored == exact.receivers == exact.counters["receivers looked at"]
    # from above, the square hides the ground up to x = -0.6 and its shadow begins at x = -1: of the 0.4 that are seen,
    # a shadow moved by 0.25 leaves 0.25 lit, and what it darkens instead is hidden
    shadowed = lit.false_lit_count
    assert shadowed is not None
    assert shifted.false_lit_count == pytest.approx(0.25 / 0.4 * shadowed, rel=0.1)
    assert shifted.false_shadow_count == lit.false_shadow_count == 0

    common = ended.record.environment
    assert common["plugins"].keys() == {"tiny_scene.py", "misbehaving.py"}
    assert all(origin["digest"] for origin in common["plugins"].values())
    assert common["warp"]["device"].startswith("cpu")
    for row, own in ((exact, {}), (lit, {"imagined": "1"})):
        assert row.environment["libraries"] == common["libraries"] | own
        assert all(row.environment[name] == common[name] for name in common if name != "libraries")
        assert len(row.environment["load_before"]) == len(row.environment["load_after"]) == 3

    for row in ended.rows:
        assert row.rounds == 8 == len(row.samples["build"]) == len(row.samples["shade"]) == len(row.samples["camera"])
        for stage, duration in row.stages.items():
            assert duration == np.median(row.samples[f"stages.{stage}"])
            assert len(row.samples[f"stages.{stage}"]) == row.rounds
        static = np.add(row.samples["camera"], row.samples["shade"])
        assert row.static_frame_ms == pytest.approx(np.median(static))
        assert row.dynamic_frame_ms == pytest.approx(np.median(static + row.samples["build"]))
        assert row.shade_ms_low is not None
        assert row.shade_ms is not None
        assert row.shade_ms_low <= row.shade_ms
        assert row.peak_rss_bytes is not None
        assert row.peak_rss_bytes > 50e6
        assert {"result", "reference", "failures"} <= row.artifacts.keys()
        with Store.open(tmp_path, create=False) as store:
            assert store.artifact(row.artifacts["result"]).startswith(b"\x89PNG")
    assert exact.bytes_kept == 4
    assert exact.kept == {"shift": 4}
    assert list(exact.stages) == ["nothing", "formula"]
    assert len({row.comparison for row in ended.rows}) == 1, "timed in the same rounds"
    assert exact.visibility_digest != shifted.visibility_digest


def test_building_belongs_to_every_frame_where_the_parameters_make_it_so(measure: Measure) -> None:
    rarely, always = measure("watchful:every_frame=false/true").rows
    assert always.static_frame_ms == always.dynamic_frame_ms
    shading = np.add(rarely.samples["camera"], rarely.samples["shade"])
    assert rarely.static_frame_ms == pytest.approx(np.median(shading))
    assert rarely.dynamic_frame_ms == pytest.approx(np.median(shading + rarely.samples["build"]))


def test_a_method_is_told_what_moved_and_the_picture_is_the_same(measure: Measure) -> None:
    rows = measure("told", "instanced", moving=["everything", "object", "light", "camera"]).rows
    told = {row.moving: row.counters for row in rows if row.method == "told"}
    names = "instances moved", "light moved", "view moved"
    assert {moving: tuple(counters[name] for name in names) for moving, counters in told.items()} == {
        "everything": (2, 1, 1),
        "object": (1, 0, 0),
        "light": (0, 1, 0),
        "camera": (0, 0, 1),
    }
    instanced = {row.moving: row for row in rows if row.method == "instanced"}
    assert len({row.visibility_digest for row in instanced.values()}) == 1
    built = {moving: row.counters["maps built"] for moving, row in instanced.items()}
    assert built["camera"] == 0
    assert built["everything"] == built["light"] == 2


def test_a_picture_of_numbers_is_kept_beside_the_others(measure: Measure, tmp_path: Path) -> None:
    (row,) = measure("watchful").rows
    with Store.open(tmp_path, create=False) as store:
        assert store.artifact(row.artifacts["picture-left to right"]).startswith(b"\x89PNG")


def test_the_same_plan_again_measures_nothing_and_fresh_measures_all(measure: Measure) -> None:
    first = measure("formula")
    second = measure("formula")
    assert second.record.run_id == first.record.run_id
    assert second.seen.remaining == 0
    assert second.seen.rows == []
    assert "has a row for every case already" in second.seen.notes[0]
    fresh = measure("formula", fresh=True)
    assert fresh.record.run_id != first.record.run_id
    assert [r.visibility_digest for r in fresh.rows] == [r.visibility_digest for r in first.rows]


def test_an_interrupted_run_keeps_its_rows_and_goes_on_with_exactly_the_rest(measure: Measure) -> None:
    methods = ("formula", "unavailable", "good:level=1/2")
    broken = measure(*methods, observer=Recorder(raise_at_row=3))
    assert broken.record.status is RunStatus.INTERRUPTED
    assert len(broken.rows) == 3
    resumed = measure(*methods)
    assert resumed.record.run_id == broken.record.run_id
    assert resumed.record.status is RunStatus.COMPLETE
    assert resumed.seen.remaining == len(resumed.seen.rows) == 1
    assert {row.case_key for row in resumed.seen.rows}.isdisjoint(row.case_key for row in broken.rows)
    kept = [row for row in resumed.rows if row.case_key in {r.case_key for r in broken.rows}]
    assert kept == broken.rows, "finished rows are left as they were"
    for row in resumed.seen.rows:
        assert len(row.samples["baseline shade"]) == row.rounds, "timed beside the comparison's first case"


def test_an_error_of_the_run_itself_is_no_interruption(measure: Measure, tmp_path: Path) -> None:
    with pytest.raises(ZeroDivisionError):
        measure("good", "unavailable", observer=Recorder(raise_at_row=1, error=ZeroDivisionError))
    with Store.open(tmp_path, create=False) as store:
        (record,) = store.runs()
        assert record.status is RunStatus.FAILED
        assert [row.method for row in store.rows(record.run_id)] == ["unavailable"]


def test_one_run_at_a_time_works_on_a_folder(tmp_path: Path) -> None:
    plan = planned(tmp_path, "unavailable")
    hold = (
        "import fcntl, sys; lock = open(sys.argv[1], 'a+'); fcntl.flock(lock, fcntl.LOCK_EX);"
        "lock.write('4711'); lock.flush(); print(flush=True); input()"
    )
    with subprocess.Popen(
        [sys.executable, "-c", hold, str(tmp_path / "run.lock")], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    ) as other:
        assert other.stdout is not None
        other.stdout.readline()
        with pytest.raises(StoreError, match=r"another run \(process 4711\) is at work here"):
            carry_out(plan)
        other.kill()
    assert carry_out(plan).record.status is RunStatus.COMPLETE, "the lock of a dead process is no lock"


def test_a_view_that_cannot_be_made_is_the_error_of_its_cases(tmp_path: Path) -> None:
    files = (*PLUGIN_FILES, PLUGINS / "scenes_gone_wrong.py")
    ended = carry_out(planned(tmp_path, "good", scenes=("looking-away", "tiny"), plugin_files=files))
    assert [row.outcome for row in ended.rows] == [Outcome.ERROR, Outcome.OK]
    assert "the camera sees no surface" in ended.rows[0].reason


def test_cases_that_do_not_fit_in_memory_are_measured_in_blocks_beside_the_first(
    measure: Measure, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("shadowbench.runner.block.MOST_PARKED", 2)
    first, second, third = measure("formula", "good:level=1/2").rows
    assert first.comparison == second.comparison != third.comparison
    assert "baseline shade" not in second.samples
    assert len(third.samples["baseline shade"]) == third.rounds


def test_every_sample_of_a_pixel_is_a_receiver_with_its_own_shadow(measure: Measure) -> None:
    (one,) = measure("formula", scenes=("tiny:ground=8",), sizes=["96x64"]).rows
    (four,) = measure("formula", scenes=("tiny:ground=8",), sizes=["96x64"], pixel_samples=[4]).rows
    assert (one.pixel_samples, four.pixel_samples) == (1, 4)
    assert one.receivers is not None
    assert four.receivers == 4 * one.receivers == four.counters["receivers looked at"]
    assert four.failure_count == 0
    assert one.case_key != four.case_key
    assert one.visibility_digest != four.visibility_digest


def test_a_picture_of_too_many_receivers_is_refused_before_anything_is_made(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"8192x8192 pixels of 256 samples and 1 layers are 17,179,869,184 receivers"):
        planned(tmp_path, "formula", sizes=["8192x8192"], pixel_samples=[256])
