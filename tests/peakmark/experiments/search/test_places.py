"""Floors and rooms with any kind of marker: equal but for the kind."""

import numpy as np
import pytest

from peakmark.experiments.search.places import Place, View, view_of
from peakmark.markers.optimum import Limit
from peakmark.markers.patterns import Made, Variant
from peakmark.score.arrays import printed_arrays


def view(place: Place, made_for: Made, limit: Limit, number: int = 1) -> View:
    found = view_of(place, 5, number, Variant("dark", limit, made_for), Variant("light", limit, made_for))
    assert found is not None
    return found


@pytest.mark.parametrize("place", ["floors", pytest.param("rooms", marks=pytest.mark.slow)])
def test_views_differ_in_the_markers_alone(place: Place) -> None:
    one, other = view(place, "surf", "energy"), view(place, "sift", "range")
    assert [m.kind.replace("surf", "sift-range") for m in one.truth] == [m.kind for m in other.truth]
    corners, others = (np.array([m.corners_xy for m in each.truth]) for each in (one, other))
    seen = [m.visible_fraction > 0.99 for m in one.truth]
    assert np.allclose(corners[seen], others[seen], atol=0.6)  # whole texels of either pattern
    changed = np.abs(one.gray.astype(int) - other.gray) > 12
    assert 0 < changed.mean() < 0.2
    assert one.scene is not None
    assert other.scene is not None
    codes = [[(array.name, array.code) for array in printed_arrays(each.scene)] for each in (one, other)]
    assert codes[0] == codes[1]
    assert codes[0]


def test_a_number_is_a_view_of_its_own() -> None:
    one, other = (view("floors", "sift", "energy", number).gray for number in (1, 2))
    assert one.shape != other.shape or (one != other).any()
