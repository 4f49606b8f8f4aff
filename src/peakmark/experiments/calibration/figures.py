"""How far calibrations are from the truth, and whether their σ say so."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray
from peaksim.camera.camera import Camera

from peakmark.calibration.fit import Calibration, calibrate
from peakmark.calibration.guided import guided_view
from peakmark.calibration.views import BoardView
from peakmark.errors import InputError
from peakmark.experiments.calibration.boards import BOARDS, Board, SeenBoard, board_map, photograph, points_m
from peakmark.experiments.calibration.study import SIZE, SimulatedCamera, StudyConfig, simulated_camera
from peakmark.score.statistics import rate

FOCAL_PERCENT, CENTER_PX, FIELD_PX = 0.03, 0.15, 0.05
"""Errors up to which a calibration counts as good."""

_GRID = (33, 25)
"""Points over the image at which fields are compared."""


@dataclass(frozen=True)
class CameraFigures:
    """One camera, calibrated with one board."""

    camera: int
    """Its number."""
    lens: str
    """Model that was fitted."""
    board: str
    """See `Board`."""
    views: int
    """Photographs in which enough of the board was found, and that were used."""
    focal_percent: float | None
    """Error of fx; this and all else is None where there were too few photographs."""
    center_px: float | None
    """Distance of the principal points."""
    field_px: float | None
    """Where both cameras see a ray, root mean square over the whole image."""
    rotated_px: float | None
    """The same after the rotation that brings both nearest: what is left if the camera's pose is free."""
    nees: float | None
    """Normalised squared error of all parameters."""
    parameters: int
    """Their number, which `nees` has on average if σ is honest."""
    rms_px: float | None
    """Reprojection error."""


def camera_figures(config: StudyConfig, number: int, seen: Sequence[dict[Board, SeenBoard]]) -> list[CameraFigures]:
    """Return the figures of all boards for one camera, from what each of its photographs shows."""
    simulated = simulated_camera(config, number)
    return [_figures(config, simulated, number, board, [each[board] for each in seen]) for board in BOARDS]


def _figures(
    config: StudyConfig, simulated: SimulatedCamera, number: int, board: Board, seen: Sequence[SeenBoard]
) -> CameraFigures:
    lens, true = simulated.lens, simulated.camera
    views = [_view(board, k, each) for k, each in enumerate(seen) if each.rows]
    try:
        found = calibrate(views, SIZE, lens)
        if board == "peakmark":
            found = calibrate(_guided(config, simulated, number, found), SIZE, lens)
    except InputError:
        return CameraFigures(number, lens, board, len(views), None, None, None, None, None, 0, None)
    error = found.values - np.array([true.fx, true.fy, true.cx, true.cy, *true.distortion])
    field, rotated = _fields(found.camera, true)
    return CameraFigures(
        number,
        lens,
        board,
        len(found.views),
        100 * abs(float(error[0])) / true.fx,
        float(np.hypot(*error[2:4])),
        field,
        rotated,
        float(error @ np.linalg.solve(found.covariance, error)),
        len(error),
        found.rms_px,
    )


def _view(board: Board, number: int, seen: SeenBoard) -> BoardView:
    rows = np.array(seen.rows, dtype=np.intp)
    return BoardView(f"{number}", rows, points_m(board)[rows], np.array(seen.xy), np.array(seen.sigma_px))


def _guided(config: StudyConfig, simulated: SimulatedCamera, number: int, alone: Calibration) -> list[BoardView]:
    """Return the views as `peakmark calibrate` measures them after a first fit."""
    return [
        guided_view(
            photograph(config, simulated, number, int(fit.view.name), "peakmark"),
            fit.view,
            board_map(),
            alone.camera,
            fit.world_from_camera,
        )
        for fit in alone.views
    ]


def _fields(found: Camera, true: Camera) -> tuple[float, float]:
    """Return how far two cameras see the same rays apart, px rms over the image, as they are and best rotated."""
    x, y = np.meshgrid(*(np.linspace(0, size - 1, count) for size, count in zip(SIZE, _GRID, strict=True)))
    px = np.column_stack([x.ravel(), y.ravel()])
    rays, theirs = true.unproject(px), found.unproject(px)
    rotation = _nearest_rotation(rays, theirs)
    return _rms(found.project(rays) - px), _rms(found.project(rays @ rotation.T) - px)


def _nearest_rotation(rays: NDArray[np.float64], others: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the (3, 3) rotation that brings rays nearest to others (Kabsch)."""
    a, b = (each / np.linalg.norm(each, axis=1, keepdims=True) for each in (rays, others))
    good = np.isfinite(a + b).all(axis=1)
    u, _, v = np.linalg.svd(b[good].T @ a[good])
    return np.asarray(u @ np.diag([1, 1, np.linalg.det(u @ v)]) @ v)


def _rms(gaps: NDArray[np.float64]) -> float:
    return float(np.sqrt(np.nanmean((gaps**2).sum(axis=1))))


def study_rows(figures: Sequence[CameraFigures]) -> list[tuple[str, Any, Any, Any, Any]]:
    """Return name, value, ends of the interval and cases: per lens and board medians, how many are good, and NEES."""
    rows: list[tuple[str, Any, Any, Any, Any]] = []
    for lens in sorted({each.lens for each in figures}):
        for board in BOARDS:
            chosen = [each for each in figures if (each.lens, each.board) == (lens, board)]
            rows += _rows_of(f"{board}, {lens}", chosen)
    return rows


def _rows_of(name: str, chosen: Sequence[CameraFigures]) -> list[tuple[str, Any, Any, Any, Any]]:
    good = [each for each in chosen if each.field_px is not None]
    rows: list[tuple[str, Any, Any, Any, Any]] = []
    for title, value in (
        ("focal length (%), median", [each.focal_percent for each in good]),
        ("principal point (px), median", [each.center_px for each in good]),
        ("field (px rms), median", [each.field_px for each in good]),
        ("field after the best rotation (px rms), median", [each.rotated_px for each in good]),
    ):
        if value:
            rows.append(
                (f"{name}: {title}", float(np.median(np.array(value, dtype=np.float64))), None, None, len(good))
            )
    within = sum(
        (each.focal_percent or 0) <= FOCAL_PERCENT
        and (each.center_px or 0) <= CENTER_PX
        and (each.field_px or 0) <= FIELD_PX
        for each in good
    )
    rows.append(rate(within, len(chosen)).row(f"{name}: good in all three"))
    if good:
        freedom = sum(each.parameters for each in good)
        low, high = (float(scipy.stats.chi2.ppf(p, freedom)) / freedom for p in (0.025, 0.975))
        share = sum(each.nees or 0.0 for each in good) / freedom
        rows.append((f"{name}: NEES a parameter; honest within", share, low, high, len(good)))
    return rows
