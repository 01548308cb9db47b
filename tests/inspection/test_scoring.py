"""Scores of visibilities made elsewhere: of the truth itself, and of a technique's own result."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from builders import box_over_ground
from opened_views import opened

from shadowbench.errors import UsageError
from shadowbench.inspection import kept_visibility
from shadowbench.inspection.opening import open_case
from shadowbench.inspection.receiver import report_on
from shadowbench.inspection.scoring import kernel_of_case, score
from shadowbench.inspection.space import laid_out
from shadowbench.plugins import Registry
from shadowbench.rows import Outcome, ResultRow, RunStatus
from shadowbench.service.pictures import check_png
from shadowbench.store import Store

MEASURES = (
    *("scored", "receivers", "failure_count", "false_lit_count", "false_shadow_count", "acne_count", "interior_count"),
    *("edge_band_count", "turned_away_count", "rmse", "edge_band_rmse", "interior_rmse", "ssim", "flip", "leak_mean"),
    *("leak_p99", "reference_error"),
)


def test_the_truth_itself_never_fails(tmp_path: Path) -> None:
    seen = opened(box_over_ground())
    with Store.open(tmp_path) as store:
        row = score(store, seen, seen.reference.visibility, "perfect", source="perfect.npy")
        (kept,) = store.rows(row.run_id)
        assert store.find_run(row.run_id).status is RunStatus.COMPLETE
        assert store.artifact(kept.artifacts["failures"])[:4] == b"\x89PNG"
    assert (kept.outcome, kept.method, kept.method_title) == (Outcome.OK, "perfect", "perfect (external)")
    assert (kept.failure_count, kept.rmse, kept.ssim) == (0, 0.0, 1.0)
    assert (kept.build_ms, kept.shade_ms, kept.dynamic_frame_ms, kept.bytes_kept) == (None, None, None, None)


def test_the_truth_upside_down_always_fails(tmp_path: Path) -> None:
    seen = opened(box_over_ground())
    with Store.open(tmp_path) as store:
        row = score(store, seen, 1.0 - seen.reference.visibility, "inverse", source="inverse.npy")
    assert row.failure_percent == 100.0


@pytest.mark.parametrize("method", ["shadow-map", "pcf"])
def test_a_techniques_own_result_scores_as_its_row(
    method: str, cases: tuple[Path, dict[str, ResultRow]], tmp_path: Path
) -> None:
    folder, rows = cases
    case = open_case(rows[method], folder, ())
    kernel = kernel_of_case(Registry(), rows[method], case.seen)
    assert (kernel is None) == (method == "shadow-map")
    with Store.open(tmp_path) as store:
        row = score(store, case.seen, case.visibility, "again", source="again.npy", kernel=kernel)
    for name in MEASURES:
        assert getattr(row, name) == getattr(rows[method], name), name


def test_a_row_can_stand_beside_the_case_and_is_replaced_when_scored_again(
    cases: tuple[Path, dict[str, ResultRow]],
) -> None:
    folder, rows = cases
    beside = rows["ray-traced"]
    seen = open_case(beside, folder, ()).seen
    with Store.open(folder) as store:
        before = len(store.rows(beside.run_id))
        for value in (0.0, 1.0):
            visibility = np.full(seen.receivers.count, value, np.float32)
            row = score(store, seen, visibility, "flat", source="flat.npy", beside=beside)
            assert (row.run_id, row.experiment) == (beside.run_id, beside.experiment)
        kept = store.rows(beside.run_id)
    assert len(kept) == before + 1
    assert kept[-1].false_lit_count
    assert not kept[-1].false_shadow_count


def test_a_case_made_elsewhere_is_looked_into_as_far_as_it_is_known(
    cases: tuple[Path, dict[str, ResultRow]], tmp_path: Path
) -> None:
    folder, rows = cases
    own = open_case(rows["shadow-map"], folder, ())
    with Store.open(folder) as store:
        row = score(store, own.seen, own.visibility, "engine", source="engine.npy")
    case = open_case(row, folder, ())
    assert case.method is None
    assert np.array_equal(case.visibility, own.visibility)
    assert case.notes[0].startswith("made elsewhere")
    assert len(case.notes) == 1
    acne = int(np.flatnonzero(own.measured.masks["acne"])[0])
    mine, theirs = report_on(own, acne), report_on(case, acne)
    assert (theirs.account, theirs.filtered_truth) == (None, None)
    for name in ("truth", "visibility", "blocker", "classes", "reasons", "light_space", "surface"):
        assert getattr(theirs, name) == getattr(mine, name), name
    painted, said = laid_out(case)
    expected, described = laid_out(own)
    assert np.array_equal(painted["point_colours"], expected["point_colours"])
    assert said["legend"] == described["legend"]
    lost = row.model_copy(update={"artifacts": {}})
    with pytest.raises(UsageError, match="score it again"):
        open_case(lost, folder, ())


@pytest.mark.parametrize("shape", [(1,), (2,), (1000,), (7, 3), (1001, 3)])
def test_a_kept_visibility_comes_back_to_the_bit(shape: tuple[int, ...]) -> None:
    values = np.random.default_rng(1).random(shape).astype(np.float32)
    content = kept_visibility.written(values)
    check_png(content, 1 << 20)  # a results service takes it
    assert np.array_equal(kept_visibility.read(content, shape), values)
    with pytest.raises(UsageError, match="another number of receivers"):
        kept_visibility.read(content, (5 * shape[0], *shape[1:]))
