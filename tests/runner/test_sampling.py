"""What a sample is made of: repeats of short frames, and the frames before the first."""

import pytest

from shadowbench.runner.sampling import MOST_REPEATS, WarmUp, repeats_for


@pytest.mark.parametrize(
    ("duration_ms", "repeats"), [(50.0, 1), (1.0, 1), (0.99, 2), (0.5, 2), (0.3, 4), (0.02, 50), (0.001, MOST_REPEATS)]
)
def test_what_is_short_is_repeated_until_a_sample_lasts_a_millisecond(duration_ms: float, repeats: int) -> None:
    assert repeats_for(duration_ms) == repeats


def test_what_takes_no_time_at_all_is_repeated_no_more_than_allowed() -> None:
    assert repeats_for(0.0) == MOST_REPEATS


def _frames(*durations_ms: float) -> int:
    """Return how many of these frames go before the first sample."""
    warm_up = WarmUp()
    for duration in durations_ms:
        assert not warm_up.is_over
        warm_up.add(duration)
    assert warm_up.is_over
    return warm_up.frames


def test_warming_up_goes_on_while_frames_get_faster() -> None:
    assert _frames(100.0, 101.0) == 2
    assert _frames(100.0, 50.0, 40.0, 39.0) == 4


def test_warming_up_has_an_end() -> None:
    assert _frames(*(1000.0 * 0.9**n for n in range(2)), 100.0, 90.0) == 4  # two seconds
    assert _frames(*(10.0 * 0.9**n for n in range(10))) == 10  # ten frames
    assert _frames(2500.0) == 1
