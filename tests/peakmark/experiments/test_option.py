"""Options: both ends are allowed, None is no number, and the message names what was expected."""

import pytest

from peakmark.errors import InputError
from peakmark.experiments.option import check_choice, check_range


def test_both_ends_and_none_are_allowed() -> None:
    for value in (0.25, 8, None):
        check_range("stretch", value, 0.25, 8.0)
    check_range("seed", 10**30, 0)
    check_choice("rule", "paper", ("joint", "paper"))


def test_what_is_beyond_is_one_line() -> None:
    with pytest.raises(InputError, match=r"^--frames: expected 1…1000000, got 0$"):
        check_range("frames", 0, 1, 1_000_000)
    with pytest.raises(InputError, match=r"^--length: expected 0\.5…8 m, got nan$"):
        check_range("length", float("nan"), 0.5, 8.0, " m")
    with pytest.raises(InputError, match=r"^--seed: expected 0 or more, got -1$"):
        check_range("seed", -1, 0)
    with pytest.raises(InputError, match=r"^--renderer: expected auto, gl or exact, got ray$"):
        check_choice("renderer", "ray", ("auto", "gl", "exact"))
