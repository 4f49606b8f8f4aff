"""What alignments say of their errors, and what stands in for it."""

from dataclasses import replace

import numpy as np
import pytest

from peakmark.identification.api import identify
from peakmark.localise.residuals import refined_sigmas
from peakmark.localise.uncertainty import CENTER_FLOOR_PX, marker_fits
from tests.helpers import marker_view


def test_a_marker_of_a_search_states_its_own_spread() -> None:
    marker = identify(marker_view(60))[0]
    assert marker.spread is not None
    fits = marker_fits([marker])
    assert fits.measurements == 7
    assert (np.diag(fits.covariance[0]) > np.diag(marker.spread.covariance)).all()
    assert np.sqrt(fits.covariance[0, 0, 0]) < 2 * CENTER_FLOOR_PX
    assert marker.spread.covariance == pytest.approx(marker.spread.covariance.T)


def test_without_one_its_size_tells() -> None:
    marker = replace(identify(marker_view(60))[0], spread=None)
    assert marker.affinity is not None
    fits = marker_fits([marker])
    assert fits.measurements == 5
    assert np.sqrt(fits.covariance[0, 0, 0]) == pytest.approx(refined_sigmas(marker.affinity[None])[0][0])
