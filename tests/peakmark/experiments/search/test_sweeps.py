"""Single markers as the sweeps draw and disturb them, and that the search finds what it should."""

import numpy as np
import pytest

from peakmark.errors import InputError
from peakmark.experiments.search import sweeps
from peakmark.experiments.search.sweeps import SweepConfig, cells, disturbed, draw_marker, found_in
from peakmark.markers.patterns import Variant

CENTER = np.array([160.25, 120.0])


def drawn(tilt_deg: float = 0.0) -> np.ndarray:
    return draw_marker(CENTER, 34.0, tilt_deg, 30.0, Variant("dark"), (240, 320))


@pytest.mark.parametrize("tilt_deg", [0.0, 60.0])
def test_a_drawn_marker_has_its_area_and_its_centre(tilt_deg: float) -> None:
    black = np.clip(0.5 - drawn(tilt_deg), 0, None) / 0.5  # the core, a ninth of the pattern, and a little of its edges
    y, x = np.mgrid[:240, :320]
    assert black.sum() == pytest.approx(34**2 / 9, rel=0.1)
    assert np.allclose([(black * x).sum(), (black * y).sum()] / black.sum(), CENTER, atol=0.02)


def test_disturbances_are_what_they_are_called() -> None:
    levels = drawn()

    def image_of(name: str, value: float) -> np.ndarray:
        return disturbed(levels, name, value, CENTER, np.random.default_rng(0)).astype(float)

    plain = image_of("side_px", 34)
    assert (image_of("noise_sigma", 12) - image_of("noise_sigma", 0)).std() == pytest.approx(12, rel=0.05)
    shaded = image_of("shadow_edge", 0.5) - 40
    assert shaded[:, :150].mean() == pytest.approx((plain[:, :150] - 40).mean(), rel=0.01)
    assert shaded[:, 180:].mean() == pytest.approx((plain[:, 180:] - 40).mean() / 2, rel=0.01)
    assert image_of("overexposure", 3).max() == 255
    assert image_of("gamma", 2.2).mean() < plain.mean() < image_of("gamma", 0.45).mean()
    assert image_of("sharpening", 2).std() > plain.std() > image_of("motion_px", 6).std()
    assert (image_of("clean_side_px", 34) - plain).std() == pytest.approx(1, rel=0.1)
    hidden = np.abs(image_of("covered", 0.3) - plain) > 6
    y, x = np.mgrid[:240, :320]
    assert hidden[np.hypot(x - CENTER[0], y - CENTER[1]) < 19.2].mean() == pytest.approx(0.3, abs=0.06)


def test_cells_are_listed_once_and_seeded_by_number() -> None:
    listed = list(cells())
    assert len(set(listed)) == len(listed)
    config = SweepConfig(markers=2)
    assert [found_in(config, "noise_sigma", 2.0, 0.0, 0, k) for k in range(2)] == [True, True]


def test_markers_that_are_covered_in_part_are_found() -> None:
    config = SweepConfig(markers=4, seed=5)
    assert sum(found_in(config, "covered", 0.3, 0.0, 0, k) for k in range(4)) >= 3


def test_numbers_out_of_range_are_named() -> None:
    with pytest.raises(InputError, match="--markers"):
        SweepConfig(markers=0)
    assert sweeps.SweepConfig().markers == 20
