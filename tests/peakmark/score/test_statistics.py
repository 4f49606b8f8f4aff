"""Rates and quantiles: against scipy's, and on samples whose figures are known."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import binom, binomtest, norm

from peakmark.score.statistics import (
    Rate,
    percentile_interval,
    pooled,
    quantiles,
    rate,
    recall_by,
    resample_counts,
    wilson,
)


@given(trials=st.integers(1, 2000), share=st.floats(0, 1))
def test_wilson_ends_are_the_rates_whose_score_is_the_quantile(trials: int, share: float) -> None:
    successes = round(share * trials)
    z = norm.ppf(0.975)
    for end, sign in zip(wilson(successes, trials), (1, -1), strict=True):
        assert 0 <= end <= 1
        if 0 < end < 1:
            score = sign * (successes / trials - end) / np.sqrt(end * (1 - end) / trials)
            assert score == pytest.approx(z, abs=1e-7)


def test_wilson_covers_a_known_rate_about_95_percent_of_the_time() -> None:
    hits = np.arange(101)
    covered = [low <= 0.9 <= high for low, high in (wilson(int(k), 100) for k in hits)]
    assert binom.pmf(hits, 100, 0.9)[covered].sum() == pytest.approx(0.95, abs=0.02)


def test_no_trials_say_nothing() -> None:
    assert wilson(0, 0) == (0.0, 1.0)
    assert rate(0, 0) == Rate(None, None, None, 0)
    assert pooled([]) == rate(0, 0)


@given(trials=st.integers(1, 500), share=st.floats(0, 1))
def test_a_rate_is_scipys_and_keeps_its_count(trials: int, share: float) -> None:
    successes = round(share * trials)
    found, expected = rate(successes, trials), binomtest(successes, trials).proportion_ci(0.95, "wilson")
    assert (found.low, found.high) == pytest.approx((expected.low, expected.high), abs=1e-12)
    assert (found.count, found.of) == (successes, trials)


def test_a_rate_and_its_interval_by_hand() -> None:
    found = rate(99, 100)
    assert (found.value, found.of) == (0.99, 100)
    assert (found.low, found.high) == (pytest.approx(0.9455, abs=1e-3), pytest.approx(0.9982, abs=1e-3))


def test_pooled_rates_are_the_rate_of_all_cases() -> None:
    assert pooled([rate(1, 3), rate(0, 0), rate(7, 7)]) == rate(8, 10)
    assert rate(1, 4).row("recall")[:2] == ("recall", 0.25)


def test_quantiles_leave_out_what_is_not_known() -> None:
    found = quantiles([3.0, np.nan, 1.0, np.inf, 2.0])
    assert (found[50], found.largest, found.of) == (2.0, 3.0, 3)
    assert found[99] is None


def test_quantiles_of_nothing_are_none_and_make_rows_of_empty_cells() -> None:
    found = quantiles([np.nan], (50, 99))
    assert found.to_plain() == {"p50": None, "p99": None, "of": 0}
    assert found.rows("error") == [("error: p50", None, None, None, 0), ("error: p99", None, None, None, 0)]


def test_the_interval_of_the_median_covers_it_about_95_percent_of_the_time() -> None:
    rng = np.random.default_rng(5)
    covered = 0
    for _ in range(200):
        low, high = quantiles(rng.normal(size=60), (50,)).intervals[50]
        covered += low <= 0 <= high
    assert 0.89 <= covered / 200 <= 0.99


def test_plain_quantiles_have_the_names_of_result_json() -> None:
    plain = quantiles(np.arange(101.0)).to_plain()
    assert list(plain) == ["p50", "p50_interval", "p95", "p95_interval", "max", "of"]
    assert (plain["p50"], plain["p95"], plain["max"], plain["of"]) == (50.0, 95.0, 100.0, 101)
    assert plain["p50_interval"][0] < 50 < plain["p50_interval"][1]


def test_recall_by_bins_counts_edges_once_and_leaves_empty_bins_out() -> None:
    rows = recall_by((0, 10, 20, 30), [0.0, 9.9, 10.0, 20.0, 20.0], [1.0, np.nan, 2.0, 3.0, 5.0])
    assert [(row.low, row.high) for row in rows] == [(0, 10), (10, 20), (20, 30)]
    assert [row.recall for row in rows] == [rate(1, 2), rate(1, 1), rate(2, 2)]
    assert [row.error_px[50] for row in rows] == [1.0, 2.0, 4.0]
    assert recall_by((0, 10, 20), [15.0], [np.nan])[0].recall == rate(0, 1)


def test_counts_take_as_many_cases_as_there_are() -> None:
    counts = resample_counts(7)
    assert (counts.sum(axis=1) == 7).all()
    assert np.array_equal(counts, resample_counts(7))


def test_an_interval_of_values_that_are_mostly_missing_is_none() -> None:
    assert percentile_interval(np.array([1.0] * 90 + [np.nan] * 10), 0.95) is None
    assert percentile_interval(np.array([1.0] * 99 + [np.nan]), 0.95) == (1.0, 1.0)
