"""Receivers of measured cases: their truth, the method's account, and why they fail."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from builders import flat_receivers

from shadowbench.errors import UsageError
from shadowbench.inspection.opening import OpenCase, open_case
from shadowbench.inspection.receiver import ReceiverReport, nearest_pixel, receiver_at, report_on
from shadowbench.inspection.verdicts import Finding, reasons
from shadowbench.metrics import CONTACT_DISTANCE
from shadowbench.receivers import Receivers
from shadowbench.rows import ResultRow
from shadowbench.store import Store

Cases = tuple[Path, dict[str, ResultRow]]


@pytest.fixture(scope="module")
def shadow_map(cases: Cases) -> OpenCase:
    folder, rows = cases
    return open_case(rows["shadow-map"], folder, ())


@pytest.fixture(scope="module")
def filtered(cases: Cases) -> OpenCase:
    folder, rows = cases
    return open_case(rows["pcf"], folder, ())


def _first(case: OpenCase, mask: str) -> ReceiverReport:
    return report_on(case, int(np.flatnonzero(case.measured.masks[mask])[0]))


def test_a_case_opened_again_gives_its_rows_numbers(shadow_map: OpenCase) -> None:
    assert shadow_map.notes == ()
    for name in ("failure_count", "acne_count", "edge_band_count", "scored"):
        assert shadow_map.measured.columns[name] == getattr(shadow_map.row, name)


def test_the_account_and_the_light_space_agree(shadow_map: OpenCase) -> None:
    for index in range(0, shadow_map.seen.receivers.count, 97):
        report = report_on(shadow_map, index)
        assert report.account is not None
        assert report.light_space is not None
        assert report.account.visibility == report.visibility[0]
        said = {q.name: q.value for q in report.account.steps[0].quantities}
        assert said["depth"] == pytest.approx(report.light_space.depth, abs=1e-12)
        assert said["x"] == pytest.approx(report.light_space.u * said["resolution"], abs=1e-9)


def test_a_blocker_lies_on_the_ray_to_the_light_before_the_receiver(shadow_map: OpenCase) -> None:
    reference = shadow_map.seen.reference
    hidden = np.flatnonzero((reference.blocker >= 0) & ~reference.turned_away)
    for index in hidden[:: max(1, len(hidden) // 8)].tolist():
        report = report_on(shadow_map, index)
        blocker, own = report.blocker, report.light_space
        assert blocker is not None
        assert blocker.light_space is not None
        assert own is not None
        assert blocker.distance > 0.0
        assert blocker.light_space.depth < own.depth
        assert (blocker.light_space.u, blocker.light_space.v) == pytest.approx((own.u, own.v), abs=1e-5)


def test_acne_is_called_by_name(shadow_map: OpenCase) -> None:
    report = _first(shadow_map, "acne")
    assert report.reasons[0].startswith("FALSE SHADOW")
    assert report.reasons[1].startswith("acne")
    assert {"false_shadow", "acne", "interior"} <= set(report.classes)


def test_the_filtered_truth_of_one_receiver_is_that_of_the_whole_picture(filtered: OpenCase) -> None:
    from shadowbench.filtered_reference import filtered_reference

    seen = filtered.seen
    kernel = filtered.method.kernel(seen.receivers)
    assert kernel is not None
    whole = filtered_reference(seen.world, seen.receivers, seen.light, seen.reference, kernel, filtered.context)
    between = np.flatnonzero((whole.visibility > 0.0) & (whole.visibility < 1.0))
    for index in between[:: max(1, len(between) // 5)].tolist():
        assert report_on(filtered, index).filtered_truth == (float(whole.visibility[index]),)


def test_the_sky_has_no_receiver_but_a_nearest_pixel_that_has(filtered: OpenCase) -> None:
    lower_half = _without_upper_rows(flat_receivers(8, 6), rows=3)
    seen = replace(filtered.seen, receivers=lower_half)
    assert receiver_at(seen, 5, 1) is None
    assert nearest_pixel(seen, 5, 1) == (5, 3)
    assert receiver_at(seen, 5, 3) == 5


def test_pixels_and_samples_that_are_not_there_are_refused(filtered: OpenCase) -> None:
    with pytest.raises(UsageError, match="0,0 to 47,31"):
        receiver_at(filtered.seen, 48, 0)
    with pytest.raises(UsageError, match="receivers 0 to 0"):
        receiver_at(filtered.seen, 24, 25, 1)


def _without_upper_rows(receivers: Receivers, *, rows: int) -> Receivers:
    gone = rows * receivers.width
    kept = {name: getattr(receivers, name)[gone:] for name in ("pixel", "position", "normal", "triangle", "valid")}
    return replace(receivers, **kept, first_of_pixel=np.maximum(receivers.first_of_pixel - gone, 0))


def test_other_code_and_other_numbers_are_told(cases: Cases) -> None:
    folder, rows = cases
    old = rows["ray-traced"].model_copy(update={"quality_key": "other", "failure_count": 3})
    notes = open_case(old, folder, ()).notes
    assert len(notes) == 2
    assert "changed since this row was made" in notes[0]
    assert "failure_count was 3, is 0" in notes[1]


def test_cases_are_found_by_the_beginning_of_their_key(cases: Cases) -> None:
    from shadowbench.inspection.finding import find_case

    folder, rows = cases
    with Store.open(folder) as store:
        for row in rows.values():
            assert find_case(store, row.case_key[:12]).method == row.method
            assert find_case(store, f"latest:{row.case_key}").method == row.method


def _found(classes: set[str], *, truth: float, result: float, distance: float = 0.5) -> list[str]:
    return list(
        reasons(
            Finding(
                is_valid=True,
                is_in_field=True,
                is_turned_away=False,
                classes=frozenset(classes),
                truth=(truth,),
                result=(result,),
                blocker_distance=distance,
                diagonal=10.0,
            )
        )
    )


def test_reasons_name_what_the_masks_say() -> None:
    assert "peter-panning" in _found({"false_lit", "peter_panning"}, truth=0.0, result=1.0, distance=0.1)[1]
    assert f"{CONTACT_DISTANCE:.0%}" in _found({"false_lit", "peter_panning"}, truth=0.0, result=1.0)[1]
    assert "edge band" in _found({"false_lit", "edge_band"}, truth=0.0, result=1.0)[1]
    assert "light leaks" in _found({"false_lit"}, truth=0.0, result=0.7)[1]
    assert "thinner than a texel" in _found({"false_lit"}, truth=0.0, result=1.0)[1]
    assert "acne" in _found({"false_shadow", "acne"}, truth=1.0, result=0.0)[1]
    assert _found(set(), truth=1.0, result=1.0) == ["right: equal to the truth"]
    assert _found({"classified"}, truth=1.0, result=0.75)[-1] == "the method's own test calls it a failure"
