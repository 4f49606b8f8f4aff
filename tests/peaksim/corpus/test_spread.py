"""Spreads: the quantile of each form, its limits, and the forms that contradict themselves."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from peaksim.corpus.spread import Spread, pick_index
from pydantic import ValidationError
from scipy.stats import norm, truncnorm

FORMS = [
    3.5,
    [-2, 7],
    {"uniform": [0, 1]},
    {"log_uniform": [0.01, 100]},
    {"integers": [-3, 4]},
    {"normal": [10, 2], "within": [5, 13]},
    {"choice": [1, 5, 2]},
    {"choice": [1, 5, 2], "weights": [0, 3, 1]},
]


@pytest.mark.parametrize("form", FORMS, ids=str)
def test_every_share_gives_a_value_within_the_limits_and_larger_shares_give_no_smaller_ones(form: object) -> None:
    spread = Spread.model_validate(form)
    values = np.array([spread.at(share) for share in np.linspace(0, 1, 501, endpoint=False)])
    low, high = spread.limits
    assert (values >= low).all()
    assert (values <= high).all()
    if spread.choice is None:
        assert (np.diff(values) >= 0).all()


@given(st.floats(0, 1, exclude_max=True))
def test_uniform_and_log_uniform_are_linear_in_their_own_scale(share: float) -> None:
    assert Spread.model_validate([2, 6]).at(share) == pytest.approx(2 + 4 * share)
    assert np.log(Spread.model_validate({"log_uniform": [2, 6]}).at(share)) == pytest.approx(
        np.log(2) + share * np.log(3)
    )


def test_integers_are_all_equally_likely_and_whole() -> None:
    spread = Spread.model_validate({"integers": [2, 5]})
    values = [spread.at((i + 0.5) / 400) for i in range(400)]
    assert {value: values.count(value) for value in set(values)} == {2.0: 100, 3.0: 100, 4.0: 100, 5.0: 100}


def test_a_wide_normal_is_the_normal_distribution_and_a_narrow_one_is_cut() -> None:
    wide = Spread.model_validate({"normal": [1, 2], "within": [-100, 100]})
    assert [wide.at(share) for share in (0.1, 0.5, 0.9)] == pytest.approx(norm.ppf([0.1, 0.5, 0.9], 1, 2))
    narrow = Spread.model_validate({"normal": [1, 2], "within": [1, 3]})
    assert norm.cdf(narrow.at(0.5), 1, 2) == pytest.approx((norm.cdf(1, 1, 2) + norm.cdf(3, 1, 2)) / 2)


@pytest.mark.parametrize("within", [(-3, 3), (4.5, 5), (-5, -4.5), (-40, 1), (1, 40), (-5, 40), (-40, 5)])
def test_a_cut_normal_is_exact_in_both_tails(within: tuple[float, float]) -> None:
    shares = (0.0, 1e-9, 0.1, 0.5, 0.9, 1 - 1e-9)
    spread = Spread.model_validate({"normal": [0, 1], "within": list(within)})
    wanted = np.clip(truncnorm.ppf(shares, *within), *within)
    assert [spread.at(share) for share in shares] == pytest.approx(wanted, rel=0, abs=1e-8)


def test_weights_are_shares_of_the_whole() -> None:
    counts = np.bincount([pick_index((i + 0.5) / 1000, (1.0, 0.0, 3.0)) for i in range(1000)], minlength=3)
    assert counts.tolist() == [250, 0, 750]


@pytest.mark.parametrize(
    ("form", "words"),
    [
        ([3, 1], "expected low ≤ high, got 3 and 1"),
        ({"uniform": [0, 1], "choice": [1]}, "exactly one"),
        ({}, "exactly one"),
        ({"log_uniform": [0, 1]}, "positive limits"),
        ({"normal": [0, 1]}, "normal and within"),
        ({"within": [0, 1], "choice": [1]}, "normal and within"),
        ({"normal": [0, 0], "within": [-1, 1]}, "positive sigma"),
        ({"normal": [0, 1], "within": [50, 60]}, "within 5 sigma"),
        ({"choice": []}, "at least 1"),
        ({"choice": [1, 2], "weights": [1]}, "one weight for each of the 2"),
        ({"choice": [1, 2], "weights": [0, 0]}, "positive weight"),
        ({"integers": [0.5, 2]}, "integer"),
        ([1], "required"),
        ("much", "expected a number, a pair"),
        (True, "expected a number, a pair"),
        (float("nan"), "finite"),
        ({"unifrom": [0, 1]}, "unifrom"),
    ],
    ids=str,
)
def test_a_contradiction_is_refused(form: object, words: str) -> None:
    with pytest.raises(ValidationError, match=words):
        Spread.model_validate(form)
