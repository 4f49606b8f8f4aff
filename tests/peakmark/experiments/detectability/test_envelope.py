import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from peakmark.errors import InputError
from peakmark.experiments.detectability.envelope import COLUMNS, Rates, distance_m, load_rates, reach, sentence

SIDES = np.array([10.0, 20.0, 40.0, 80.0])


def rates(*lows):
    """Return rates of one tilt a row of lower bounds."""
    grid = np.array(lows, float)
    return Rates(np.arange(len(grid)) * 30.0, SIDES[: grid.shape[1]], grid, grid)


def test_the_largest_side_that_is_found_is_the_nearest_distance():
    (one,) = reach(rates([0.5, 0.96, 0.99, 0.97]), focal_px=1000, side_m=0.08)
    assert (one.nearest_m, one.farthest_m, one.gaps_m) == (pytest.approx(1.0), pytest.approx(4.0), ())


def test_a_size_that_fails_between_two_that_do_not_is_a_gap():
    (one,) = reach(rates([0.96, 0.96, 0.2, 0.96]), focal_px=1000, side_m=0.08)
    assert (one.nearest_m, one.farthest_m) == (pytest.approx(1.0), pytest.approx(8.0))
    assert one.gaps_m == ((pytest.approx(1.0), pytest.approx(4.0)),)
    assert sentence(0.08, one) == "8 cm at 0°: 1 to 8 m, with misses from 1 to 4 m"


def test_where_nothing_is_found_there_is_no_distance():
    one, other = reach(rates([0.1, 0.2], [0.99, 0.99]), focal_px=1000, side_m=0.08)
    assert (one.nearest_m, one.farthest_m, one.gaps_m) == (None, None, ())
    assert sentence(0.08, one) == "8 cm at 0°: not found"
    assert (other.tilt_deg, other.nearest_m) == (30.0, pytest.approx(4.0))


@given(st.lists(st.booleans(), min_size=1, max_size=12), st.floats(100, 5000), st.floats(0.01, 1))
def test_gaps_and_reach_say_for_each_size_whether_it_is_inside(good, focal_px, side_m):
    sides = np.arange(1, len(good) + 1) * 7.0
    grid = np.where(good, 0.97, 0.3)[None]
    (one,) = reach(Rates(np.zeros(1), sides, grid, grid), focal_px, side_m)
    for side, is_good in zip(sides, good, strict=True):
        at = distance_m(side, focal_px, side_m)
        inside = one.nearest_m is not None and one.nearest_m <= at <= one.farthest_m
        assert is_good == (inside and not any(near < at < far for near, far in one.gaps_m))


@pytest.mark.parametrize("noise", [0.0, 10.0])
@pytest.mark.parametrize("detector", ["surf", "surf-paper"])
def test_the_shipped_rates_are_sure_and_fall_with_tilt(detector, noise):
    found = load_rates("surf-dark", detector, noise)
    assert (np.diff(found.tilt_deg) > 0).all()
    assert (np.diff(found.side_px) > 0).all()
    assert (found.detected >= found.detected_low).all()
    assert found.detected[0].mean() > found.detected[-1].mean()
    at = {one.tilt_deg: one.farthest_m for one in reach(found, 1774, 0.08)}
    assert at[0.0] > 7
    assert 4 < at[60.0] < at[0.0]


@pytest.mark.parametrize("noise", [0.0, 10.0])
@pytest.mark.parametrize(
    ("marker", "detector"), [("sift-dark", "sift"), ("sift-range-dark", "sift"), ("sift-range-dark", "surf")]
)
def test_sifts_markers_and_discs_were_measured_at_the_same_sizes_and_tilts(marker, detector, noise):
    found, surf = load_rates(marker, detector, noise), load_rates("surf-dark", "surf", noise)
    assert np.array_equal(found.side_px, surf.side_px)
    assert np.array_equal(found.tilt_deg, surf.tilt_deg)
    assert found.detected.max() >= 0.97


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a,b\n", "expected columns marker, detector"),
        (",".join(COLUMNS) + "\nsurf-dark,surf,0,0,10,1,1\nsurf-dark,surf,0,30,20,1,1\n", "some are missing"),
        (
            ",".join(COLUMNS) + "\nsurf-dark,surf,0,0,ten,1,1\n",
            r"envelope.csv: line 2: expected 7 columns, numbers from",
        ),
        (
            ",".join(COLUMNS) + "\nsurf-dark,surf,0,0\n",
            r"envelope.csv: line 2: expected 7 columns, numbers from tilt_deg",
        ),
        (",".join(COLUMNS) + "\nsurf-dark,sift,0,0,10,1,1\n", r"surf-dark/sift/0, got surf-dark/surf/0"),
    ],
)
def test_unusable_tables_are_named(tmp_path, text, message):
    path = tmp_path / "envelope.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=message):
        load_rates(path=path)


def test_a_missing_table_is_named(tmp_path):
    with pytest.raises(InputError, match=r"none.csv: cannot be read: No such file"):
        load_rates(path=tmp_path / "none.csv")


@pytest.mark.parametrize("change", [{"focal_px": 0}, {"focal_px": np.nan}, {"side_m": -1}, {"required": 1.0}])
def test_bad_numbers_are_refused(change):
    with pytest.raises(InputError, match=r"expected .* got "):
        reach(rates([1, 1]), **{"focal_px": 1000, "side_m": 0.08, **change})
