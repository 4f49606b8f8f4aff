"""What must be found: every limit is itself allowed, and stretching makes markers larger."""

from dataclasses import replace

import numpy as np
import pytest

from peakmark.score.wanted import IN_VIEW, READABLE, Wanted, polarity_of, stretched_side_px
from tests.peakmark.score.test_markers import truth

MARKER = replace(truth("a", 100, 40), side_px=20.0, tilt_deg=45.0, visible_fraction=0.95)


def test_a_marker_at_every_limit_is_wanted() -> None:
    assert IN_VIEW.includes(MARKER)
    assert READABLE.includes(MARKER)
    assert Wanted(20.0, 45.0, 0.95, ("surf-dark",)).includes(MARKER)


@pytest.mark.parametrize(
    "change",
    [{"side_px": 19.99}, {"tilt_deg": 45.01}, {"visible_fraction": 0.949}, {"side_px": np.nan}],
    ids=lambda change: next(iter(change)),
)
def test_a_marker_beyond_one_limit_is_not(change: dict[str, float]) -> None:
    assert not READABLE.includes(replace(MARKER, **change))  # type: ignore[arg-type]


def test_other_kinds_do_not_count_at_all() -> None:
    surf = Wanted(kinds=("surf", "sift"))
    others = [MARKER, replace(MARKER, kind="aruco"), replace(MARKER, kind="sift-light", visible_fraction=0.5)]
    assert [surf.counts(marker) for marker in others] == [True, False, True]
    assert surf.of(others) == [MARKER]


def test_a_stretch_by_rows_enlarges_a_marker_by_the_root_of_its_rows_factor() -> None:
    rows = np.linspace(1, 4, 61)
    assert stretched_side_px(MARKER, 4.0) == pytest.approx(40.0)
    assert stretched_side_px(MARKER, rows) == pytest.approx(20 * np.sqrt(rows[40]))
    below = replace(MARKER, center_xy=np.array([0.0, 99.0]))
    assert stretched_side_px(below, rows) == pytest.approx(40.0)
    assert not Wanted(min_side_px=30.0).includes(MARKER)
    assert Wanted(min_side_px=30.0, stretch=rows).includes(below)


def test_the_kind_names_the_polarity() -> None:
    assert [polarity_of(kind) for kind in ("surf-dark", "surf-range-light")] == ["dark", "light"]
