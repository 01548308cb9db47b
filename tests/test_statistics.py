"""The statistics of timing, against the binomial distribution, SciPy, and simulations of known coverage."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from shadowbench.statistics import (
    Interval,
    PairedContrast,
    SeparateContrast,
    Verdict,
    bootstrap_median,
    differences_among,
    has_two_modes,
    interval_of,
    judge,
    median_over_processes,
    outliers,
    paired,
    ratio_by_round,
    ratio_of_runs,
    separate,
)

PROCESSES = (0, 0, 0, 0, 1, 1, 1, 1, 2, 2, 2, 2)


# Medians


@pytest.mark.parametrize(
    ("count", "low", "high"),
    [(6, 1, 6), (7, 1, 7), (8, 1, 8), (9, 2, 8), (11, 2, 10), (12, 3, 10), (15, 4, 12), (20, 6, 15), (30, 10, 21)],
)
def test_the_interval_is_the_one_of_the_printed_tables_for_a_median(count: int, low: int, high: int) -> None:
    found = interval_of([float(value) for value in range(count, 0, -1)])
    assert (found.low, found.high) == (low, high)


@pytest.mark.parametrize("confidence", [0.95, 0.99, 0.9975])
@pytest.mark.parametrize("count", range(10, 60, 7))
def test_the_interval_is_the_narrowest_that_holds_the_median_often_enough(count: int, confidence: float) -> None:
    found = interval_of([float(value) for value in range(1, count + 1)], confidence)
    assert found.low is not None
    assert found.high == count + 1 - found.low
    coverage = [1.0 - 2.0 * float(stats.binom.cdf(rank - 1, count, 0.5)) for rank in range(count)]
    assert coverage[int(found.low)] >= confidence
    assert coverage[int(found.low) + 1] < confidence


@pytest.mark.parametrize("count", [1, 2, 5])
def test_fewer_than_six_samples_have_a_median_but_no_interval(count: int) -> None:
    assert interval_of([1.0] * count) == Interval(1.0)


@given(st.lists(st.floats(0.0, 1e6), min_size=6, max_size=40))
def test_the_median_lies_in_its_interval_and_order_does_not_matter(samples: list[float]) -> None:
    found = interval_of(samples)
    assert found.low is not None
    assert found.high is not None
    assert min(samples) <= found.low <= found.estimate <= found.high <= max(samples)
    assert found == interval_of(samples[::-1])


def test_the_bootstrap_interval_is_scipys() -> None:
    samples = np.random.default_rng(5).lognormal(size=40)
    found = bootstrap_median(list(samples))
    theirs = stats.bootstrap((samples,), np.median, n_resamples=9999, method="percentile", rng=1).confidence_interval
    assert found.estimate == np.median(samples)
    assert found.low == pytest.approx(theirs.low, rel=0.03)
    assert found.high == pytest.approx(theirs.high, rel=0.03)


def test_the_bootstrap_of_the_same_samples_is_the_same_and_of_equal_samples_a_point() -> None:
    samples = [1.0, 3.0, 2.0, 5.0, 4.0]
    assert bootstrap_median(samples, 3) == bootstrap_median(samples, 3)
    assert bootstrap_median([2.0] * 5) == Interval(2.0, 2.0, 2.0)


def test_bootstrapping_processes_of_any_size_draws_each_of_them_as_often() -> None:
    found = bootstrap_median([1.0] * 3 + [2.0] * 8 + [3.0], processes=[0] * 3 + [1] * 8 + [2])
    assert (found.estimate, found.low, found.high) == (2.0, 1.0, 3.0)


def test_a_rows_interval_is_wider_where_processes_differ_and_never_narrower() -> None:
    rng = np.random.default_rng(0)
    alike = list(rng.normal(100.0, 1.0, 12))
    apart = [sample + 10.0 * process for sample, process in zip(alike, PROCESSES, strict=True)]
    for samples in (alike, apart):
        plain, whole = interval_of(samples), median_over_processes(samples, PROCESSES)
        assert whole.wider(plain) == whole
    assert median_over_processes(alike, [0] * 12) == interval_of(alike)
    found = median_over_processes(apart, PROCESSES)
    assert found.low is not None
    assert found.high is not None
    assert found.low < 102.0
    assert found.high > 118.0


# Two cases


@given(st.lists(st.floats(-1.0, 1.0), min_size=1, max_size=40))
def test_the_p_value_of_rounds_is_the_sign_tests(logs: list[float]) -> None:
    against = min(sum(v <= 0 for v in logs), sum(v >= 0 for v in logs))
    theirs = stats.binomtest(against, len(logs), 0.5, alternative="less").pvalue * 2.0
    assert PairedContrast(tuple(logs)).p_value == pytest.approx(min(1.0, theirs))


def test_the_ratio_is_the_median_of_the_rounds_ratios_whatever_the_machine_did_meanwhile() -> None:
    drift = np.linspace(1.0, 5.0, 11)
    ratios = np.array([1.02, 1.03, 1.01, 1.05, 1.04, 1.03, 1.02, 1.06, 1.03, 1.03, 1.01])
    found = ratio_by_round(list(drift * ratios), list(drift))
    assert found.estimate == pytest.approx(1.03)
    assert found.low == pytest.approx(np.sort(ratios)[1])
    assert found.high == pytest.approx(np.sort(ratios)[9])


def test_swapping_the_two_inverts_the_ratio() -> None:
    rng = np.random.default_rng(1)
    a, b = list(rng.lognormal(size=12)), list(rng.lognormal(size=12))
    for there, back in (
        (ratio_by_round(a, b, PROCESSES), ratio_by_round(b, a, PROCESSES)),
        (ratio_of_runs(a, b), ratio_of_runs(b, a)),
    ):
        assert there.low is not None
        assert there.high is not None
        assert back.estimate == pytest.approx(1.0 / there.estimate)
        assert back.low == pytest.approx(1.0 / there.high)
        assert back.high == pytest.approx(1.0 / there.low)


def test_processes_are_judged_by_students_t_of_their_medians() -> None:
    logs = (0.10, 0.11, 0.12, 0.13, 0.02, 0.03, 0.04, 0.05, 0.06, 0.07, 0.08, 0.09)
    medians = [0.115, 0.035, 0.075]
    contrast = PairedContrast(logs, PROCESSES)
    theirs = stats.ttest_1samp(medians, 0.0)
    assert contrast.p_value == pytest.approx(theirs.pvalue)
    assert PairedContrast(logs).p_value == pytest.approx(2.0 / 2.0**12)
    found, expected = contrast.interval(), theirs.confidence_interval()
    assert found.low == pytest.approx(math.exp(expected.low))
    assert found.high == pytest.approx(math.exp(expected.high))


def test_of_one_process_that_is_known_three_in_a_hundred_may_be_its_layout() -> None:
    rounds = [0] * 12
    for factor, verdict in ((1.02, Verdict.NO_DIFFERENCE), (1.04, Verdict.SLOWER), (0.96, Verdict.FASTER)):
        a, b = [factor] * 12, [1.0] * 12
        for contrast in (paired(a, b, rounds), separate(a, b, rounds, rounds)):
            assert judge([contrast])[0].verdict is verdict
            found = contrast.interval()
            assert (found.low, found.estimate, found.high) == pytest.approx((factor / 1.03, factor, factor * 1.03))
    assert judge([paired([1.02] * 12, [1.0] * 12)])[0].verdict is Verdict.SLOWER, "of which nothing is known"


def test_rounds_of_their_own_are_judged_by_mann_and_whitney() -> None:
    rng = np.random.default_rng(2)
    for first, second in ((6, 9), (12, 12), (20, 5)):
        a, b = rng.lognormal(0.3, 0.5, first), rng.lognormal(0.0, 0.5, second)
        contrast = separate(list(a), list(b))
        theirs = stats.mannwhitneyu(np.log(a), np.log(b), method="exact").pvalue
        assert contrast.p_value == pytest.approx(theirs)
        differences = np.subtract.outer(np.log(a), np.log(b))
        assert contrast.interval().estimate == pytest.approx(np.exp(np.median(differences)))


def test_many_pairs_of_samples_are_judged_as_few_are() -> None:
    rng = np.random.default_rng(3)
    a, b = rng.lognormal(0.05, 0.2, 80), rng.lognormal(0.0, 0.2, 90)
    theirs = stats.mannwhitneyu(np.log(a), np.log(b), method="asymptotic").pvalue
    assert separate(list(a), list(b)).p_value == pytest.approx(theirs, rel=0.02)


def test_processes_of_separate_runs_are_judged_by_welchs_t() -> None:
    first = [0.1 * process + 0.001 * place for place, process in enumerate(PROCESSES)]
    second = [sample + 0.3 for sample in first]
    contrast = SeparateContrast(tuple(first), tuple(second), PROCESSES, PROCESSES)
    medians = [np.median(first[start : start + 4]) for start in (0, 4, 8)]
    theirs = stats.ttest_ind(medians, np.add(medians, 0.3), equal_var=False)
    assert contrast.p_value == pytest.approx(theirs.pvalue)
    assert contrast.interval().high == pytest.approx(math.exp(theirs.confidence_interval().high))


@pytest.mark.parametrize("confidence", [0.9, 0.95, 0.99])
def test_an_interval_leaves_out_one_exactly_where_the_test_says_so(confidence: float) -> None:
    rng = np.random.default_rng(4)
    for shift in np.linspace(0.0, 0.1, 40):
        a = list(rng.lognormal(shift, 0.05, 12))
        b = list(rng.lognormal(0.0, 0.05, 12))
        for contrast in (
            paired(a, b),
            paired(a, b, [0] * 12),
            paired(a, b, PROCESSES),
            separate(a, b),
            separate(a, b, [0] * 12, [0] * 12),
            separate(a, b, PROCESSES, PROCESSES),
        ):
            found = contrast.interval(confidence)
            if found.low is not None and found.high is not None:
                leaves_out = found.low > 1.0 or found.high < 1.0
                assert leaves_out == (contrast.p_value <= 1.0 - confidence)


def test_too_few_rounds_show_nothing() -> None:
    (found,) = judge([paired([2.0] * 5, [1.0] * 5)])
    assert found.verdict is Verdict.NO_DIFFERENCE
    assert found.ratio == Interval(2.0)


def test_durations_of_nothing_at_all_have_a_ratio() -> None:
    assert ratio_by_round([0.0] * 6, [0.0] * 6) == Interval(1.0, 1.0, 1.0)


def _simulated(count: int, *, slower: float, layout: float, noise: float, seed: int) -> list[PairedContrast]:
    """Cases of 4 rounds in each of 3 processes; each process is shifted as a whole by ``layout``."""
    rng = np.random.default_rng(seed)
    found = []
    for _ in range(count):
        logs = slower + rng.normal(0.0, noise, 12) + np.repeat(rng.normal(0.0, layout, 3), 4)
        found.append(PairedContrast(tuple(logs), PROCESSES))
    return found


@pytest.mark.parametrize(("layout", "noise"), [(0.0, 0.02), (0.01, 0.02), (0.02, 0.005)])
def test_cases_that_do_not_differ_are_told_apart_in_at_most_one_of_twenty(layout: float, noise: float) -> None:
    p_values = np.array([c.p_value for c in _simulated(2000, slower=0.0, layout=layout, noise=noise, seed=7)])
    assert np.mean(p_values <= 0.05) <= 0.05 + 3.0 * math.sqrt(0.05 * 0.95 / 2000)


def test_without_processes_the_shifts_of_whole_processes_would_pass_for_differences() -> None:
    contrasts = _simulated(500, slower=0.0, layout=0.02, noise=0.005, seed=7)
    blind = np.array([PairedContrast(c.log_ratios).p_value for c in contrasts])
    assert np.mean(blind <= 0.05) > 0.2


def test_the_interval_of_the_ratio_holds_the_true_one_in_at_least_95_of_100() -> None:
    true = math.exp(0.03)
    intervals = [c.interval() for c in _simulated(1000, slower=0.03, layout=0.01, noise=0.01, seed=8)]
    held = [i.low is not None and i.high is not None and i.low <= true <= i.high for i in intervals]
    assert np.mean(held) >= 0.95 - 3.0 * math.sqrt(0.05 * 0.95 / 1000)


def test_a_slowdown_well_above_the_noise_is_found_and_its_direction_is_right() -> None:
    for slower, verdict in ((0.03, Verdict.SLOWER), (-0.03, Verdict.FASTER)):
        contrasts = _simulated(100, slower=slower, layout=0.002, noise=0.005, seed=9)
        verdicts = [judge([contrast])[0].verdict for contrast in contrasts]
        assert verdicts.count(verdict) >= 95
        assert set(verdicts) <= {verdict, Verdict.NO_DIFFERENCE}


# Many cases


@given(st.lists(st.floats(0.0, 1.0), min_size=1, max_size=30))
def test_the_correction_is_benjamini_and_hochbergs(p_values: list[float]) -> None:
    expected = stats.false_discovery_control(p_values, method="bh") <= 0.05
    assert differences_among(p_values) == list(expected)


def test_a_whole_table_of_short_but_plain_comparisons_is_decided() -> None:
    contrasts = [paired([2.0 + case] * 6, [1.0] * 6) for case in range(20)]
    assert all(found.verdict is Verdict.SLOWER for found in judge(contrasts))


def test_one_of_many_must_be_plainer_than_one_alone() -> None:
    weak = PairedContrast(tuple([0.01] * 11 + [-0.01] * 2))  # p = 0.022
    even = [PairedContrast(tuple([0.01, -0.01] * 6)) for _ in range(9)]
    assert judge([weak])[0].verdict is Verdict.SLOWER
    assert judge([weak, *even])[0].verdict is Verdict.NO_DIFFERENCE


def test_in_a_table_an_interval_leaves_out_one_exactly_where_a_difference_is_declared() -> None:
    rng = np.random.default_rng(11)
    contrasts = [PairedContrast(tuple(rng.normal(shift, 0.02, 20))) for shift in np.linspace(-0.03, 0.03, 25)]
    found = judge(contrasts)
    assert {each.verdict for each in found} == set(Verdict)
    for each in found:
        assert each.ratio.low is not None
        assert each.ratio.high is not None
        leaves_out = each.ratio.low > 1.0 or each.ratio.high < 1.0
        assert leaves_out == (each.verdict is not Verdict.NO_DIFFERENCE)
        assert each.confidence >= 0.95


def test_a_table_without_cases_judges_nothing() -> None:
    assert judge([]) == []


# Odd samples


def test_far_outliers_are_marked_by_tukeys_rule_and_near_ones_are_not() -> None:
    samples = [100.0, 102.0, 104.0, 106.0, 108.0, 130.0, 150.0]  # quartiles 103 and 119: up to 167
    assert outliers(samples) == []
    assert outliers([*samples[:5], 105.0, 150.0, 60.0]) == [6, 7]


def test_what_lies_within_a_hundredth_of_the_median_is_no_outlier() -> None:
    assert outliers([100.0] * 9 + [100.9]) == []
    assert outliers([100.0] * 9 + [101.1]) == [9]
    assert outliers([1.0, 9.0]) == []


def test_samples_in_two_groups_are_seen_as_such() -> None:
    rng = np.random.default_rng(12)
    near, far = rng.normal(10.0, 0.1, 12), rng.normal(13.0, 0.1, 8)
    assert has_two_modes(list(np.concatenate([near, far])))
    assert not has_two_modes(list(np.concatenate([near, far[:3]])))  # outliers, fewer than a fifth


@pytest.mark.parametrize("count", [16, 30, 60])
def test_samples_of_one_group_hardly_ever_pass_for_two(count: int) -> None:
    rng = np.random.default_rng(13)
    for draw in (rng.normal, rng.uniform, rng.exponential):
        taken = [has_two_modes(list(100.0 + 10.0 * draw(size=count))) for _ in range(1000)]
        assert np.mean(taken) <= 0.01


def test_too_few_samples_have_one_mode() -> None:
    assert not has_two_modes([1.0] * 8 + [2.0] * 7)
