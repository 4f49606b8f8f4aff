import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import binom, norm

from peakmark.statistics import wilson


@given(trials=st.integers(1, 2000), share=st.floats(0, 1))
def test_wilson_ends_are_the_rates_whose_score_is_the_quantile(trials, share):
    successes = round(share * trials)
    z = norm.ppf(0.975)
    for end, sign in zip(wilson(successes, trials), (1, -1), strict=True):
        assert 0 <= end <= 1
        if 0 < end < 1:
            score = sign * (successes / trials - end) / np.sqrt(end * (1 - end) / trials)
            assert score == pytest.approx(z, abs=1e-4)


def test_wilson_covers_a_known_rate_about_95_percent_of_the_time():
    hits = np.arange(101)
    covered = [low <= 0.9 <= high for low, high in (wilson(k, 100) for k in hits)]
    assert binom.pmf(hits, 100, 0.9)[covered].sum() == pytest.approx(0.95, abs=0.02)


def test_no_trials_say_nothing():
    assert wilson(0, 0) == (0.0, 1.0)
