"""Markers measured where a calibration expects them: without the bias of one that knows neither pose nor lens."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from peaksim import Camera
from peaksim.geometry.pose import Pose, invert, look_at, transform

from peakmark.calibration.guided import guided_view
from peakmark.calibration.views import BoardView
from peakmark.experiments.calibration.boards import board_map, photograph
from peakmark.experiments.calibration.study import SimulatedCamera, StudyConfig, simulated_camera

CONFIG = StudyConfig(cameras=1, fisheyes=1, views=3)
SIMULATED = simulated_camera(CONFIG, 0)


def centers_px(camera: Camera, pose: Pose, rows: NDArray[np.intp]) -> NDArray[np.float64]:
    return camera.project(transform(invert(pose), board_map().centers_m[rows]))


def seen(view: int, simulated: SimulatedCamera = SIMULATED) -> NDArray[np.uint8]:
    return photograph(CONFIG, simulated, 0, view, "peakmark")


NOTHING = BoardView("a", np.zeros(0, np.intp), np.zeros((0, 3)), np.zeros((0, 2)), np.zeros(0))


def test_centres_are_without_bias_and_as_good_as_they_say() -> None:
    """Along the radius of a fisheye, where an alignment alone is off by up to 0.03 px; the guess is off, too."""
    camera, board = SIMULATED.camera, board_map()
    guess = replace(camera, fx=camera.fx * 1.001, cx=camera.cx + 0.5)
    radial, whitened = [], []
    for view in range(2):
        pose = SIMULATED.poses[view]
        found = guided_view(seen(view), NOTHING, board, guess, pose)
        assert len(found.rows) > 60
        true = centers_px(camera, pose, found.rows)
        errors, out = found.xy - true, true - [camera.cx, camera.cy]
        radial += list((errors * out).sum(axis=1) / np.linalg.norm(out, axis=1))
        whitened += list((errors / found.sigma_px[:, None]).ravel())
    assert abs(np.mean(radial)) < 0.003  # 0.006 and more without the correction
    assert 0.8 < np.sqrt(np.mean(np.square(whitened))) < 1.2


def test_markers_that_are_not_there_are_not_measured() -> None:
    board, pose = board_map(), SIMULATED.poses[0]
    image = np.random.default_rng(0).integers(0, 255, (960, 1280), dtype=np.uint8)
    assert guided_view(image, NOTHING, board, SIMULATED.camera, pose) is NOTHING
    behind = look_at([0.0, 0.0, -0.5], [0.0, 0.0, 0.0], [0, 1, 0])
    assert guided_view(seen(0), NOTHING, board, SIMULATED.camera, behind) is NOTHING


@pytest.mark.slow
def test_a_fisheye_is_calibrated_to_hundredths_of_a_pixel() -> None:
    from peakmark.experiments.calibration.boards import photographed
    from peakmark.experiments.calibration.figures import camera_figures

    config = StudyConfig(cameras=1, fisheyes=1, views=8, seed=4)
    ours, charuco, _ = camera_figures(config, 0, [photographed(config, view) for view in range(8)])
    assert (ours.lens, ours.views) == ("fisheye", 8)
    assert ours.focal_percent is not None
    assert ours.field_px is not None
    assert ours.focal_percent < 0.03
    assert ours.field_px < 0.05
    assert charuco.field_px is not None
    assert ours.field_px < charuco.field_px
    assert ours.nees is not None
    assert ours.nees < 30  # 8 are expected; 30 has a chance of 2 in 10000
