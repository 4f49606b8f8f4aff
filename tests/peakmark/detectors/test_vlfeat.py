import cv2
import numpy as np
import pytest

from peakmark import marker
from peakmark.detectors.vlfeat import signed_by_dog, vlfeat_sift


def sift_image():
    """Return a dark SIFT marker of σ 6 exactly in the middle, (80, 80), of a image."""
    return cv2.copyMakeBorder(marker.sift_marker(6.0, 73), 44, 44, 44, 44, cv2.BORDER_REPLICATE)


def test_vlfeat_is_centred_and_its_response_is_signed():
    pytest.importorskip("pycolmap")
    for image, sign in ((sift_image(), 1), (255 - sift_image(), -1)):
        found = vlfeat_sift(image)
        np.testing.assert_allclose(found.xy[0], 80, atol=0.02)
        assert found.laplacian[0] == sign
        assert found.size[0] / 2 == pytest.approx(6 / np.sqrt(2), rel=0.1)
        assert found.descriptors.shape == (len(found), 128)
        assert vlfeat_sift(image, strongest=1, describe=False).descriptors is None


def test_vlfeat_finds_markers_beyond_pycolmaps_four_octaves():
    pytest.importorskip("pycolmap")
    for sigma in (22.0, 40.0):
        found = vlfeat_sift(marker.sift_marker(sigma, 513), describe=False)
        np.testing.assert_allclose(found.xy[0], 256, atol=0.1)
        assert found.size[0] / 2 == pytest.approx(sigma / np.sqrt(2), rel=0.1)


def test_frames_are_ordered_by_the_strength_of_their_response():
    xy = np.array([[20.0, 20.0], [80.0, 80.0], [80.0, 92.0]])
    found = signed_by_dog(sift_image(), xy, np.full(3, 4.2), np.array([0.0, 370.0, -10.0]))
    np.testing.assert_array_equal(found.xy[0], [80, 80])
    assert (np.diff(found.response) <= 0).all()
    assert found.laplacian[1] == -1
    assert ((found.angle >= 0) & (found.angle < 360)).all()
