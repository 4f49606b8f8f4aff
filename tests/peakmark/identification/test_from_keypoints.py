"""Markers among key points without the image: SIFT's as they come, as roots, from COLMAP's arrays; SURF's; odd ones."""

from typing import Any

import cv2
import numpy as np
import pytest

from peakmark import surf
from peakmark.errors import InputError
from peakmark.identification.from_keypoints import identify_keypoints
from peakmark.keypoints.keypoints import Keypoints
from peakmark.markers.patterns import Variant
from tests.peakmark.identification.sift_wall import wall

DOGS = (Variant("dark", "energy", "sift"), Variant("light", "energy", "sift")) * 4


def described() -> tuple[Any, np.ndarray, list[Any]]:
    image, truth = wall(DOGS)
    points, descriptors = cv2.SIFT_create(enable_precise_upscale=True).detectAndCompute(image, None)  # type: ignore[attr-defined]
    return points, descriptors, truth


def assert_found(found: Any, truth: list[Any], least: int) -> None:
    hits = 0
    for one in found:
        kind, xy, side = min(truth, key=lambda marker: float(np.linalg.norm(marker[1] - one.xy)))
        assert np.linalg.norm(one.xy - xy) < 0.05 * side
        assert one.kind == kind.kind
        hits += 1
    assert hits >= least


def test_opencv_key_points_and_their_descriptors() -> None:
    points, descriptors, truth = described()
    found = identify_keypoints(points, descriptors)
    assert_found(found, truth, 6)  # OpenCV itself leaves some markers out
    assert all(np.allclose(one.xy, points[one.rank - 1].pt) for one in found)
    assert {one.polarity for one in identify_keypoints(points, descriptors, polarity="dark")} == {"dark"}


def test_roots_are_told_from_plain_descriptors() -> None:
    points, descriptors, truth = described()
    roots = np.rint(512 * np.sqrt(descriptors / descriptors.sum(axis=1, keepdims=True))).astype(np.uint8)
    assert_found(identify_keypoints(points, roots), truth, 6)
    for given, is_root in ((descriptors, False), (roots, True)):
        told, said = (identify_keypoints(points, given, root=root) for root in (None, is_root))
        assert [one.signature_distance for one in told] == [one.signature_distance for one in said]


@pytest.mark.parametrize("columns", [4, 6])
def test_arrays_of_a_colmap_database(columns: int) -> None:
    points, descriptors, truth = described()
    sigma, angle = np.array([p.size / 2 for p in points]), np.radians([p.angle for p in points])
    xy = np.array([p.pt for p in points]) + 0.5
    c, s = sigma * np.cos(angle), sigma * np.sin(angle)
    array = np.column_stack([xy, sigma, angle] if columns == 4 else [xy, c, -s, s, c])
    assert_found(identify_keypoints(array, descriptors), truth, 6)


def test_surf_comes_by_the_papers_rule() -> None:
    image, truth = wall((Variant("dark"), Variant("light")) * 2)
    features = surf.detect_and_describe(image, threshold=100.0)
    assert_found(identify_keypoints(features), truth, 3)
    unsigned = features.with_columns(laplacian=np.zeros(len(features)))
    assert_found(identify_keypoints(unsigned), truth, 3)


def test_no_key_points_are_no_markers() -> None:
    assert identify_keypoints(Keypoints.empty(128)) == ()


POINTS = np.array([[10.0, 10.0, 2.0, 0.0]])


@pytest.mark.parametrize(
    ("points", "descriptors", "message"),
    [
        (POINTS, None, "descriptors: expected (n, 128) of SIFT or (n, 64) of SURF, got none"),
        (POINTS, np.zeros((2, 128)), "descriptors: expected (1, 128 or 64), got (2, 128)"),
        (POINTS, np.zeros((1, 32), np.uint8), "descriptors: expected (n, 128) of SIFT or (n, 64) of SURF, got (1, 32)"),
        (POINTS, np.full((1, 128), np.nan), "descriptors: expected finite numbers, got nan or inf"),
        (POINTS, [["a"] * 128], "descriptors: expected numbers, got an array of <U1"),
        (POINTS, [[1.0] * 128, [1.0]], "descriptors: expected rows of one length, got list"),
        (POINTS, np.ones((1, 128)) * 1j, "descriptors: expected numbers, got an array of complex128"),
        (POINTS, np.ones((1, 128), bool), "descriptors: expected numbers, got an array of bool"),
        (POINTS, np.full((1, 128), 1e300), "descriptors: expected finite numbers, got nan or inf"),
        (POINTS, np.full((1, 128), -0.25), "descriptors: expected SIFT's, none below 0, got -0.25"),
        (POINTS, np.zeros(128), "descriptors: expected (1, 128 or 64), got (128,)"),
        (
            [1, 2],
            np.zeros((2, 128)),
            "keypoints: expected Keypoints, an (n, 2) array of points, or cv2.KeyPoint objects, alone or with "
            "descriptors, got list of int",
        ),
        (
            POINTS[:, :3],
            np.zeros((1, 128)),
            "keypoints: expected (n, 4) or (n, 6) numbers of a COLMAP database, got (1, 3)",
        ),
        (POINTS * [1, 1, 0, 1], np.zeros((1, 128)), "keypoints: expected finite positions and sizes above 0"),
        (
            POINTS,
            np.ones((1, 64)),
            "keypoints: expected the responses of SURF's key points, by which markers stand out, got none",
        ),
    ],
)
def test_what_does_not_fit_is_named(points: Any, descriptors: Any, message: str) -> None:
    with pytest.raises(InputError) as error:
        identify_keypoints(points, descriptors)
    assert str(error.value) == message


def test_roots_are_told_by_a_truth_value() -> None:
    with pytest.raises(InputError, match="root: expected True, False or None, got 'yes'"):
        identify_keypoints(POINTS, np.ones((1, 128)), root="yes")  # type: ignore[arg-type]
