"""Views whose truth is known, and the figures of centres."""

from pathlib import Path

import numpy as np
import pytest

from peakmark.errors import InputError
from peakmark.experiments.journal import Journal
from peakmark.experiments.search import centers
from peakmark.experiments.search.center_views import render_view
from peakmark.experiments.search.centers import KINDS, WAYS, CentersConfig, measure_centers
from peakmark.markers.patterns import Variant


def test_a_views_side_is_the_one_that_was_asked_for() -> None:
    """Where the camera looks along the marker's axis; elsewhere about that."""
    view = render_view(np.random.default_rng(0), Variant("dark", "energy", "sift"), 60.0, 0.0)
    assert view.side_px == pytest.approx(60.0, rel=1e-4)
    assert view.levels.shape == (600, 800)
    assert 500 <= view.focal_px <= 1500


def test_each_kind_way_and_noise_has_a_row(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(centers, "_CELLS", tuple((kind, 40.0, 30.0) for kind in KINDS))
    rows = measure_centers(CentersConfig(views=1), Journal.open(tmp_path, {}))
    assert len(rows) == len(KINDS) * sum(len(way.noises) for way in WAYS.values())
    assert all(row["found"] == row["views"] == 1 for row in rows)
    assert max(row["nearer_rms_px"] for row in rows if "told" in row["way"] and row["noise"] <= 2) < 0.05
    assert max(row["side_off_rms"] for row in rows if row["noise"] == 0) < 0.03


def test_numbers_out_of_range_are_named() -> None:
    with pytest.raises(InputError, match="--views"):
        CentersConfig(views=0)
