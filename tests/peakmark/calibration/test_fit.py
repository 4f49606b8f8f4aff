"""Calibrations: exact from exact sightings, honest σ over many cameras, and what does not fit is left out."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from peaksim import Camera
from peaksim.geometry.pose import Pose, invert, look_at, transform
from scipy.stats import chi2

from peakmark.calibration.fit import ViewFit, calibrate
from peakmark.calibration.lens import LENSES
from peakmark.calibration.page import advice, coverage, tilt_deg
from peakmark.calibration.views import BoardView
from peakmark.errors import InputError

SIZE = (1280, 960)
PLAIN = Camera(*SIZE, 1000.0, 1002.0, 645.0, 472.0)
BROWN = replace(PLAIN, distortion=(-0.2, 0.05, 0.0005, -0.0003, 0.01))
FISHEYE = replace(PLAIN, fx=560.0, fy=561.0, distortion=(0.02, -0.01, 0.003, -0.001), model="fisheye")
BOARD_M = np.array([[x, y, 0.0] for y in np.linspace(-0.18, 0.18, 12) for x in np.linspace(-0.12, 0.12, 9)])
"""Centres as on a board of A3."""


def poses(count: int, rng: np.random.Generator, near: float = 1.0) -> list[Pose]:
    found = []
    for _ in range(count):
        tilt, direction, roll = np.radians([rng.uniform(15, 45), *rng.uniform(0, 360, 2)])
        ray = np.array([np.sin(tilt) * np.cos(direction), np.sin(tilt) * np.sin(direction), np.cos(tilt)])
        target = np.array([*rng.uniform(-0.12, 0.12, 2), 0.0])
        found.append(look_at(near * rng.uniform(0.35, 0.6) * ray, target, [np.cos(roll), np.sin(roll), 0.05]))
    return found


def view(camera: Camera, pose: Pose, rng: np.random.Generator | None, name: str = "a") -> BoardView:
    """Return what a camera sees of the board, with errors of 0.03 px where σ is stated as 0.02: a factor of 1.5."""
    xy = camera.project(transform(invert(pose), BOARD_M))
    rows = np.flatnonzero(camera.contains(np.nan_to_num(xy, nan=-1e9)))
    seen = xy[rows] if rng is None else xy[rows] + rng.normal(0, 0.03, (len(rows), 2))
    return BoardView(name, rows, BOARD_M[rows], seen, np.full(len(rows), 0.02))


def true_values(camera: Camera, count: int) -> NDArray[np.float64]:
    k = [*camera.distortion, *[0.0] * 8]
    return np.array([camera.fx, camera.fy, camera.cx, camera.cy, *k[: count - 4]])


@pytest.mark.parametrize(
    ("camera", "lens"),
    [(PLAIN, "pinhole"), (PLAIN, "brown4"), (BROWN, "brown5"), (BROWN, "brown8"), (FISHEYE, "fisheye")],
)
def test_exact_sightings_give_the_exact_camera(camera: Camera, lens: str) -> None:
    rng = np.random.default_rng(0)
    views = [view(camera, pose, None) for pose in poses(8, rng, camera.fx / 1000)]
    found = calibrate(views, SIZE, lens)
    border = camera.border()
    assert found.rms_px < 1e-6
    assert np.abs(found.camera.project(camera.unproject(border)) - border).max() < 1e-4
    assert (found.dropped, found.markers_dropped) == ((), 0)
    assert found.parameters == LENSES[lens].parameters


def test_the_stated_covariance_is_that_of_the_errors() -> None:
    """Normalised squared errors over 30 cameras, five of them fisheyes, lie in the band of χ²."""
    nees, count = 0.0, 0
    for seed in range(30):
        rng = np.random.default_rng(seed)
        camera, lens = (FISHEYE, "fisheye") if seed % 6 == 5 else (BROWN, "brown5")
        camera = replace(camera, fx=camera.fx * rng.uniform(0.9, 1.1), cx=camera.cx + rng.uniform(-20, 20))
        found = calibrate([view(camera, pose, rng) for pose in poses(10, rng, camera.fx / 1000)], SIZE, lens)
        error = found.values - true_values(camera, len(found.values))
        nees += float(error @ np.linalg.solve(found.covariance, error))
        count += len(error)
    assert chi2.ppf(0.0005, count) < nees < chi2.ppf(0.9995, count)


def test_errors_that_a_whole_photograph_has_in_common_are_told() -> None:
    """Markers of one view that err alike, as by light or a curled board, tell less than their number says."""
    rng, nees, count, alone = np.random.default_rng(3), 0.0, 0, 0.0
    for _ in range(12):
        views = []
        for pose in poses(12, rng):
            exact = view(BROWN, pose, rng)
            u = exact.points_m[:, :2] / 0.18
            bend = 0.05 * np.column_stack([u**2, u[:, :1] * u[:, 1:]]) @ rng.standard_normal((3, 2))
            views.append(replace(exact, xy=exact.xy + bend))
        found = calibrate(views, SIZE)
        error = found.values - true_values(BROWN, len(found.values))
        nees += float(error @ np.linalg.solve(found.covariance, error))
        unscaled = found.covariance / found.view_factor**2 * found.sigma_factor**2
        alone += float(error @ np.linalg.solve(unscaled, error))
        count += len(error)
    assert chi2.ppf(0.0005, count) < nees < chi2.ppf(0.9995, count)
    assert alone > 2 * chi2.ppf(0.9995, count)


def test_the_factor_of_the_errors_is_told() -> None:
    rng = np.random.default_rng(1)
    found = calibrate([view(BROWN, pose, rng) for pose in poses(12, rng)], SIZE)
    assert found.sigma_factor == pytest.approx(1.5, rel=0.05)
    assert found.rms_px == pytest.approx(0.03 * np.sqrt(2), rel=0.05)


def test_wrong_markers_and_a_bent_board_are_left_out() -> None:
    rng = np.random.default_rng(2)
    placed = poses(10, rng)
    views = [view(BROWN, pose, rng, f"photo{n}") for n, pose in enumerate(placed)]
    views[3].xy[5] += [4.0, -3.0]
    bent = BOARD_M + np.column_stack([np.zeros((len(BOARD_M), 2)), 0.004 * np.sin(15 * BOARD_M[:, 0])])
    xy = BROWN.project(transform(invert(placed[7]), bent))
    views[7] = replace(views[7], xy=xy[views[7].rows])
    found = calibrate(views, SIZE)
    assert [name for name, _ in found.dropped] == ["photo7"]
    assert "times worse than the others: moved, bent, or out of focus" in found.dropped[0][1]
    kept = next(fit.view for fit in found.views if fit.view.name == "photo3")
    assert views[3].rows[5] not in kept.rows
    assert 1 <= found.markers_dropped < 20
    error = found.values - true_values(BROWN, 9)
    assert (np.abs(error) < 5 * found.sigmas).all()


def test_too_little_is_said() -> None:
    rng = np.random.default_rng(3)
    views = [view(BROWN, pose, rng) for pose in poses(4, rng)]
    with pytest.raises(InputError, match="expected 3 or more photographs that show the board, got 2"):
        calibrate(views[:2], SIZE)
    with pytest.raises(InputError, match=r"--lens: expected one of pinhole, .*, fisheye, got 'omni'"):
        calibrate(views, SIZE, "omni")


def test_coverage_and_tilt_are_counted_and_advised_on() -> None:
    rng = np.random.default_rng(4)
    flat = [look_at([x, 0.0, 0.5], [x, 0.0, 0.0], [0, 1, 0.05]) for x in (0.10, 0.12, 0.14)]
    slight = [look_at([x, 0.1, 0.5], [x, 0.0, 0.0], [0, 1, 0.05]) for x in (0.10, 0.12, 0.14)]
    found = calibrate([view(PLAIN, pose, rng) for pose in (*flat, *slight)], SIZE, "pinhole")
    assert coverage(found).sum() == sum(len(fit.view.xy) for fit in found.views)
    over = look_at([0.0, 0.25, 0.25 * np.sqrt(3)], [0.0, 0.0, 0.0])
    assert tilt_deg(ViewFit(view(PLAIN, over, None), over, np.zeros((1, 2)))) == pytest.approx(30, abs=0.1)
    words = " ".join(advice(found))
    assert "of the image showed no marker" in words
    assert "6 photographs were used" in words
