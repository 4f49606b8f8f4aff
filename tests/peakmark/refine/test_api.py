"""Refinement against the area-exact renderer, whose pixels and truth know nothing of the fitted model."""

import numpy as np
import pytest
from peaksim import Camera, Quad, Scene, Texture, render
from peaksim.geometry.pose import compose, rotation_about
from peaksim.scene.scene import Mark
from scipy.stats import chi2

from peakmark.errors import InputError
from peakmark.markers.patterns import surf_texture
from peakmark.parallel import threads
from peakmark.refine.api import PATTERNS, refine

GRID_PATTERNS = [name for name in PATTERNS if name.startswith("surf")]

FOCAL_PX = 800.0
SIDE_M = 0.08


def view(rng, side, tilt, pattern="surf-dark", background=128.0):
    """Return an image of one marker in a white cell, at a random phase, rotation and tilt axis, and its truth."""
    size = int(2.2 * side) + 20
    camera = Camera(size, size, FOCAL_PX, FOCAL_PX, (size - 1) / 2, (size - 1) / 2)
    distance = FOCAL_PX * SIDE_M / side * np.sqrt(np.cos(np.radians(tilt)))
    rotations = [
        rotation_about(a, d) for a, d in zip("zxz", (rng.uniform(0, 360), tilt, rng.uniform(0, 360)), strict=True)
    ]
    x, y = rng.uniform(-0.5, 0.5, 2) * distance / FOCAL_PX
    pose = compose(rotations[0] @ rotations[1] @ rotations[2] @ rotation_about("x", 180), [x, y, distance])
    texture = Texture.from_array(
        surf_texture("light" if pattern.endswith("light") else "dark", "range" if "range" in pattern else "energy")
    )
    quad = Quad("m", texture, (SIDE_M * 11 / 9,) * 2, pose, Mark("m", pattern, SIDE_M))
    frame = render(Scene((quad,), background=background), camera, np.eye(4), renderer="exact")
    return np.asarray(frame.image).reshape(size, size, -1)[:, :, 0], frame.truth[0]


def noisy(image, sigma, rng):
    return np.clip(np.rint(image + rng.normal(0, sigma, image.shape)), 0, 255).astype(np.uint8)


def roughly(truth, rng):
    """Return what a detector would know: a position 2 % of a side off and a size 15 % off."""
    return truth.center_xy + rng.normal(0, 0.014, 2) * truth.side_px, truth.side_px * rng.uniform(0.85, 1.15)


def errors(side, tilt, sigma, count, pattern="surf-dark", seed=0):
    """Return centre errors (m, 2), normalised error squared (m,) and how many of `count` converged."""
    rng = np.random.default_rng([seed, int(side), tilt, int(sigma)])
    found = []
    for _ in range(count):
        image, truth = view(rng, side, tilt, pattern)
        image = noisy(image, sigma, rng) if sigma else image
        result = refine(image, *roughly(truth, rng), pattern, focal_px=FOCAL_PX)
        if result.converged[0]:
            error = result.xy[0] - truth.center_xy
            found.append((error, error @ np.linalg.solve(result.covariance[0, :2, :2], error)))
    return np.array([e for e, _ in found]), np.array([n for _, n in found])


def rms(error):
    return np.sqrt((error**2).sum(axis=1).mean())


@pytest.mark.parametrize("side", [20, 60, 200])
@pytest.mark.parametrize("tilt", [0, 60])
def test_centre_is_within_a_twentieth_of_a_pixel_without_noise(side, tilt):
    error, _ = errors(side, tilt, 0, count=12)
    assert len(error) >= 11
    assert rms(error) <= 0.05


@pytest.mark.parametrize("side", [20, 60, 200])
@pytest.mark.parametrize("tilt", [0, 60])
def test_centre_is_within_a_tenth_of_a_pixel_at_noise_10(side, tilt):
    error, _ = errors(side, tilt, 10, count=12)
    assert len(error) >= 10
    assert rms(error) <= 0.1


def test_a_small_marker_is_found_though_it_is_seen_steeply():
    """Twelve pixels at 75° are five and a half pixels high: softening alone would mix every row with the surround."""
    error, _ = errors(12, 75, 2, 40, seed=1)
    assert len(error) >= 38
    assert rms(error) < 0.05


@pytest.mark.slow
def test_normalised_error_squared_is_within_its_95_percent_band():
    sizes_and_noises = [(side, sigma) for side in (20, 40, 80, 147) for sigma in (3, 10)]
    cells = [
        np.concatenate([errors(side, tilt, sigma, count=60, seed=1)[1] for tilt in (0, 30, 60)])
        for side, sigma in sizes_and_noises
    ]
    for normalised in cells:  # each within the band that all eight together leave with 5 %
        assert_within_band(normalised, 0.95 ** (1 / len(cells)))
    assert_within_band(np.concatenate(cells), 0.95)


def assert_within_band(normalised, share):
    """Check that a sum of squared errors of two degrees of freedom each is where `share` of such sums are."""
    low, high = chi2.ppf([(1 - share) / 2, (1 + share) / 2], 2 * len(normalised)) / len(normalised)
    assert low <= normalised.mean() <= high


@pytest.mark.parametrize("pattern", GRID_PATTERNS)
def test_every_pattern_is_found_with_its_affinity_and_corners(pattern):
    rng = np.random.default_rng(7)
    image, truth = view(rng, 60, 40, pattern)
    result = refine(image, truth.center_xy, truth.side_px, pattern, focal_px=FOCAL_PX)
    assert result.converged[0]
    gaps = np.linalg.norm(result.corners()[0][:, None] - truth.corners_xy[None], axis=-1).min(axis=1)
    assert gaps.max() < 0.2
    assert result.side_px[0] == pytest.approx(truth.side_px, rel=0.02)
    angle = np.degrees(np.arctan2(*(result.affine[0] @ [1, 0])[::-1]))
    assert abs(angle) < 70


def test_light_and_contrast_are_measured():
    rng = np.random.default_rng(8)
    image, truth = view(rng, 50, 20)
    dimmed = np.rint(image * 0.4 + 30).astype(np.uint8)
    result = refine(dimmed, truth.center_xy, truth.side_px)
    assert result.gain[0] == pytest.approx(0.4 * 255, rel=0.02)
    assert result.offset[0] == pytest.approx(30, abs=1.5)


def test_blur_is_measured_and_leaves_the_centre_alone():
    import cv2

    rng = np.random.default_rng(9)
    image, truth = view(rng, 60, 30)
    blurred = cv2.GaussianBlur(image, (0, 0), 1.5)
    result = refine(blurred, truth.center_xy, truth.side_px)
    assert result.blur_px[0] == pytest.approx(1.5, rel=0.1)
    assert np.abs(result.xy[0] - truth.center_xy).max() < 0.02


def test_nothing_is_found_where_there_is_no_marker():
    from skimage import data

    rng = np.random.default_rng(10)
    for image in (rng.integers(0, 256, (300, 300)).astype(np.uint8), data.gravel(), np.full((99, 99), 7, np.uint8)):
        positions = rng.uniform(0, 99, (60, 2))
        result = refine(image, positions, rng.uniform(10, 60, 60))
        assert not result.converged.any()
        np.testing.assert_array_equal(result.xy, positions)
        assert np.isnan(result.affine).all()


def test_the_other_polarity_is_not_taken():
    image, truth = view(np.random.default_rng(11), 40, 0, "surf-light")
    assert not refine(image, truth.center_xy, truth.side_px, "surf-dark").converged[0]


def test_no_positions_give_empty_columns():
    result = refine(np.zeros((9, 9), np.uint8), np.empty((0, 2)), 20.0)
    assert result.xy.shape == (0, 2)
    assert result.affine.shape == (0, 2, 2)
    assert result.covariance.shape == (0, 6, 6)


def test_bytes_do_not_depend_on_the_number_of_threads():
    rng = np.random.default_rng(12)
    image, truth = view(rng, 40, 20)
    positions = truth.center_xy + rng.normal(0, 0.5, (8, 2))
    results = []
    for count in (1, 2):
        with threads(count):
            results.append(refine(image, positions, truth.side_px))
    assert results[0].xy.tobytes() == results[1].xy.tobytes()
    assert results[0].covariance.tobytes() == results[1].covariance.tobytes()


@pytest.mark.parametrize(
    "call",
    [
        lambda: refine(np.zeros((9, 9)), [[1, 1]], 20),
        lambda: refine(np.zeros((9, 9, 3), np.uint8), [[1, 1]], 20),
        lambda: refine(np.zeros((9, 9), np.uint8), [[1, np.nan]], 20),
        lambda: refine(np.zeros((9, 9), np.uint8), [[1, 1]], 1e6),
        lambda: refine(np.zeros((9, 9), np.uint8), [[1, 1]], float("nan")),
        lambda: refine(np.zeros((9, 9), np.uint8), [[1, 1]], 20, "aruco"),
        lambda: refine(np.zeros((9, 9), np.uint8), [[1, 1]], 20, border=-1.0),
        lambda: refine(np.zeros((9, 9), np.uint8), [[1, 1]], 20, focal_px=0.0),
    ],
)
def test_bad_input_is_named(call):
    with pytest.raises(InputError, match=r"expected .* got "):
        call()
