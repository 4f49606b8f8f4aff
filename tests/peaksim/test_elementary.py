"""Our own exp, log, pow and trigonometry against NumPy's in higher precision."""

import numpy as np
import pytest
from peaksim.native import Function

VALUES = Function("void elementary_values(i4 function, const f8[n] x, f8[n] values)")
PAIRS = Function("void elementary_pairs(b1 is_power, const f8[n] x, const f8[n] y, f8[n] values)")
NAMES = ("exp", "log", "sin", "cos", "tan", "arctan")
RANGES = {
    "exp": (-700, 700),
    "log": (1e-9, 1e9),
    "sin": (-100, 100),
    "cos": (-100, 100),
    "tan": (-1.5, 1.5),
    "arctan": (-50, 50),
}


def ours(name: str, x: np.ndarray) -> np.ndarray:
    values = np.empty_like(x)
    VALUES(NAMES.index(name), x, values)
    return values


@pytest.mark.parametrize("name", NAMES)
def test_a_function_is_within_a_unit_or_two_in_the_last_place(name: str) -> None:
    low, high = RANGES[name]
    rng = np.random.default_rng(1)
    x = np.concatenate([rng.uniform(low, high, 100_000), rng.uniform(max(low, -1), min(high, 2), 100_000)])
    exact = getattr(np, name)(x.astype(np.longdouble))
    units = np.abs(ours(name, x) - exact) / np.spacing(np.abs(exact).astype(np.float64))
    # near their zeros sine and cosine of large angles are as near as the reduction by π
    units = np.minimum(units, np.abs(ours(name, x) - exact) / 2.0**-53) if name in ("sin", "cos") else units
    assert units.max() < (3 if name == "tan" else 1.5)


def test_values_at_the_ends() -> None:
    assert ours("exp", np.zeros(1))[0] == 1
    clamped = ours("exp", np.array([-1e9, -708.0, 1e9, 709.0, np.nan]))
    assert clamped[0] == clamped[1] > 0
    assert clamped[2] == clamped[3] < np.inf
    assert np.isnan(clamped[4])
    assert ours("log", np.array([1.0]))[0] == 0
    assert ours("arctan", np.array([-np.inf, 0.0, np.inf])).tolist() == [-np.pi / 2, 0, np.pi / 2]


def test_powers_and_directions() -> None:
    rng = np.random.default_rng(2)
    x, y, values = rng.uniform(0, 1, 10_000), rng.uniform(0.2, 5, 10_000), np.empty(10_000)
    PAIRS(True, x, y, values)
    np.testing.assert_allclose(values, x**y, rtol=1e-14)
    x, y = rng.normal(0, 1, 10_000), rng.normal(0, 1, 10_000)
    x[:4], y[:4] = [0, 1, -1, 0], [1, 0, 0, 0]
    PAIRS(False, x, y, values)
    np.testing.assert_allclose(values, np.arctan2(x, y), rtol=1e-15, atol=1e-16)
