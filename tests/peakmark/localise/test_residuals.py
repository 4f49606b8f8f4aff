"""Errors of aligned markers: of unit covariance, with what all share and what is drawn by a slight perspective."""

import numpy as np
import pytest
from peaksim.camera.camera import Camera
from peaksim.geometry.pose import compose, rotation_about

from peakmark.identification.alignment import spread_of
from peakmark.localise.pose import refine_pose
from peakmark.localise.residuals import ALIKE_PX, Correspondences, MarkerFits, Residuals, projected, shape_errors

CAMERA = Camera(640, 480, 700.0, 700.0, 319.5, 239.5)
POSE = compose(rotation_about("x", 140.0) @ rotation_about("z", 20.0), [0.1, -0.5, 0.6])
CENTERS = np.array([[x, y, 0.0] for x in (-0.1, 0.0, 0.1) for y in (-0.08, 0.06)])
TANGENTS = np.broadcast_to(0.03 * np.array([[1.0, 0.0], [0.0, -1.0], [0.0, 0.0]]), (6, 3, 2))
ALIKE = np.array([1, -1, 1, 1, -1, -1])


def seen_exactly() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    flat, slopes, perspective = projected(POSE[None], CENTERS, TANGENTS)
    return flat[0] @ CAMERA.matrix[:2, :2].T + CAMERA.matrix[:2, 2], CAMERA.matrix[:2, :2] @ slopes[0], perspective[0]


def correspondences(errors: np.ndarray, covariance: np.ndarray, drawn: np.ndarray) -> Correspondences:
    """Return exact sightings plus (n, 8) errors."""
    xy, shapes, perspective = seen_exactly()
    return Correspondences(
        xy + errors[:, :2],
        CENTERS,
        TANGENTS,
        shapes + errors[:, 2:6].reshape(-1, 2, 2),
        fits=MarkerFits(perspective + errors[:, 6:], np.broadcast_to(covariance, (6, 8, 8)), drawn),
        alike=ALIKE,
    )


def random_covariance(rng: np.random.Generator) -> np.ndarray:
    root = 0.02 * rng.standard_normal((8, 8)) * np.array([1.0] * 6 + [0.1] * 2)[:, None]
    return np.asarray(root @ root.T + 1e-6 * np.eye(8))


def test_errors_have_unit_covariance_with_what_markers_share() -> None:
    rng = np.random.default_rng(0)
    covariance, none = random_covariance(rng), np.zeros((6, 8, 2))
    root, values = np.linalg.cholesky(covariance), []
    for _ in range(3000):
        errors = 0.01 * rng.standard_normal((6, 8)) @ root.T
        shared = dict(zip((1, -1), 0.01 * ALIKE_PX * rng.standard_normal(2), strict=True))
        for k, shape in enumerate(seen_exactly()[1]):
            axes, _, along = np.linalg.svd(shape)
            errors[k, 2:6] += shared[int(ALIKE[k])] * (axes @ along).ravel()
        values.append(100 * Residuals.of(CAMERA, correspondences(errors, covariance, none)).at(POSE[None])[0])
    assert np.cov(np.array(values).T) == pytest.approx(np.eye(42), abs=0.12)


def test_what_a_slight_perspective_draws_does_not_move_the_pose() -> None:
    rng = np.random.default_rng(1)
    drawn = 0.3 * rng.standard_normal((6, 8, 2))
    errors = -np.einsum("nij,nj->ni", drawn, seen_exactly()[2])
    covariance = random_covariance(rng)
    found = refine_pose(CAMERA, POSE, correspondences(errors, covariance, drawn)).world_from_camera
    plain = refine_pose(CAMERA, POSE, correspondences(errors, covariance, np.zeros_like(drawn))).world_from_camera
    assert np.abs(found - POSE).max() < 0.1 * np.abs(plain - POSE).max()


def test_a_quarter_turn_of_the_pattern_changes_no_error_but_its_axes() -> None:
    xy, shapes, perspective = seen_exactly()
    quarter = np.array([[0.0, -1.0], [1.0, 0.0]])
    fits = MarkerFits(perspective @ quarter, np.broadcast_to(1e-4 * np.eye(8), (6, 8, 8)), np.zeros((6, 8, 2)))
    seen = Correspondences(xy, CENTERS, TANGENTS, shapes @ quarter, fits=fits)
    assert Residuals.of(CAMERA, seen).at(POSE[None]) == pytest.approx(0, abs=1e-6)


def test_measurements_leave_out_a_perspective_that_was_not_measured() -> None:
    perspective = np.array([[0.1, 0.0], [np.nan, np.nan]])
    fits = MarkerFits(perspective, np.broadcast_to(np.eye(8), (2, 8, 8)), np.zeros((2, 8, 2)))
    assert fits.measurements == 12
    assert fits[np.array([1])].measurements == 5


def test_shape_errors_are_those_of_the_lengths() -> None:
    shape = np.array([[[30.0, 0.0], [0.0, 20.0]]])
    errors = shape_errors(shape, np.array([[[[29.9, 0.0], [0.0, 20.2]]]]))
    assert errors[0, 0] == pytest.approx([0.1, -0.2, 0.0], abs=2e-3)


def test_the_spread_of_a_fit_is_that_around_what_its_prior_draws() -> None:
    """A linear fit with a prior on its last two parameters, whose normal distribution is known."""
    rng = np.random.default_rng(2)
    slopes, precision = rng.standard_normal((20, 8)), 5.0
    prior = np.diag([0.0] * 6 + [precision] * 2)
    covariance = np.linalg.inv(slopes.T @ slopes + prior)
    spread = spread_of(covariance, precision)
    assert spread.drawn == pytest.approx(covariance @ prior[:, 6:])
    assert spread.covariance == pytest.approx(covariance @ slopes.T @ slopes @ covariance)
