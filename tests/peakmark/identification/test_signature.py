"""Signatures: the paper's dimensions, and a reference that serves every rotation and size."""

import cv2
import numpy as np
import pytest

from peakmark import surf
from peakmark.errors import InputError
from peakmark.identification.signature import SIGNATURE, VERSION_INDEPENDENT, reference_descriptor, signature_distances
from tests.helpers import marker_view
from tests.places import ROOT


def test_dimensions_are_the_papers() -> None:
    assert [d + 1 for d in VERSION_INDEPENDENT] == [23, 24, 27, 28, 39, 40, 43, 44]
    assert len(SIGNATURE) == 16
    assert set(VERSION_INDEPENDENT) < set(SIGNATURE)


@pytest.mark.parametrize("turn_deg", [0, 17, 45, 90, 200])
@pytest.mark.parametrize("side_px", [40, 90])
def test_rotated_and_scaled_markers_are_near_the_reference_and_far_from_the_other_polarity(
    side_px: int, turn_deg: float
) -> None:
    for polarity, other in (("dark", "light"), ("light", "dark")):
        strongest = surf.detect_and_describe(marker_view(side_px, turn_deg, polarity), strongest=1)
        own = signature_distances(strongest.descriptors, polarity)[0]
        assert own < 0.12
        assert signature_distances(strongest.descriptors, other)[0] > 5 * own
        assert signature_distances(strongest.descriptors, None)[0] < 0.1


def test_the_reference_is_computed_once_and_cannot_be_changed() -> None:
    reference = reference_descriptor("dark")
    assert reference is reference_descriptor("dark")
    assert np.linalg.norm(reference) == pytest.approx(1, abs=1e-5)
    with pytest.raises(ValueError, match="read-only"):
        reference[0] = 0


def test_photographs_are_far_from_the_reference() -> None:
    image = cv2.imread(str(ROOT / "assets" / "textures" / "grass.png"), cv2.IMREAD_GRAYSCALE)
    features = surf.detect_and_describe(image)
    distances = signature_distances(features.descriptors, "dark")
    assert len(features) > 1000
    assert np.median(distances) > 0.7
    assert (distances < 0.3).mean() < 0.01


def test_other_descriptors_are_refused() -> None:
    with pytest.raises(InputError, match=r"expected \(n, 64\), got \(3, 128\)"):
        signature_distances(np.zeros((3, 128), np.float32))
