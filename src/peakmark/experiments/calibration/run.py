"""The study, photograph by photograph, so that an interrupted run resumes."""

from functools import partial

from peakmark.experiments.calibration.boards import Board, SeenBoard, photographed
from peakmark.experiments.calibration.figures import CameraFigures, camera_figures
from peakmark.experiments.calibration.study import StudyConfig
from peakmark.experiments.journal import Journal
from peakmark.experiments.run import OnStep, run_items
from peakmark.plain import from_plain


def run_study(
    config: StudyConfig, journal: Journal, workers: int = 1, on_step: OnStep = lambda done, of: None
) -> list[CameraFigures]:
    """Photograph every board with every camera, calibrate, and return the figures of each camera and board."""
    names = [f"{number:03d}/{view:03d}" for number in range(config.cameras) for view in range(config.views)]
    plain = run_items(journal, names, partial(photographed, config), workers, on_step)
    seen: list[dict[Board, SeenBoard]] = [
        {board: from_plain(SeenBoard, record) for board, record in each.items()} for each in plain
    ]
    calibrated = [f"{number:03d}" for number in range(config.cameras)]
    records = run_items(journal, calibrated, partial(_calibrated, config, seen), workers, on_step)
    return [from_plain(CameraFigures, each) for record in records for each in record]


def _calibrated(config: StudyConfig, seen: list[dict[Board, SeenBoard]], number: int) -> list[CameraFigures]:
    first = number * config.views
    return camera_figures(config, number, seen[first : first + config.views])
