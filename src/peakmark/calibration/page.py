"""The report of a calibration: parameters with their σ, residuals, coverage, and each photograph."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from peakmark.calibration.fit import Calibration, ViewFit
from peakmark.report import plots
from peakmark.report.page import Section, Table, svg_uri, write_report

CELLS = (8, 6)
"""Columns and rows of the image in which coverage is counted."""

LEAST_COVERAGE, LEAST_TILT_DEG = 0.8, 25.0
"""Share of cells with markers, and largest tilt, below which the page asks for more photographs."""

_ARROW_PX = 40.0
"""Length of the longest residual's arrow."""


def coverage(calibration: Calibration) -> NDArray[np.int_]:
    """Return (6, 8) how many markers were seen in each cell of the image."""
    xy = np.concatenate([fit.view.xy for fit in calibration.views])
    camera, (columns, rows) = calibration.camera, CELLS
    edges = np.linspace(-0.5, camera.height - 0.5, rows + 1), np.linspace(-0.5, camera.width - 0.5, columns + 1)
    counts, _, _ = np.histogram2d(xy[:, 1], xy[:, 0], edges)
    return np.asarray(counts, dtype=np.int_)


def tilt_deg(fit: ViewFit) -> float:
    """Return the angle between the board's normal and the line to the camera."""
    middle = fit.view.points_m.mean(axis=0)
    ray = fit.world_from_camera[:3, 3] - middle
    return float(np.degrees(np.arccos(np.clip(ray[2] / np.linalg.norm(ray), -1, 1))))


def advice(calibration: Calibration) -> list[str]:
    """Return what would make the calibration surer, in sentences; none where nothing is missing."""
    counts = coverage(calibration)
    share, tilts = float((counts > 0).mean()), [tilt_deg(fit) for fit in calibration.views]
    found = []
    if share < LEAST_COVERAGE:
        rows, columns = np.nonzero(counts == 0)
        where = _where(float(columns.mean() + 0.5) / CELLS[0], float(rows.mean() + 0.5) / CELLS[1])
        found.append(f"{1 - share:.0%} of the image showed no marker, most of it {where}: photograph the board there.")
    if max(tilts) < LEAST_TILT_DEG:
        found.append(f"the board was tilted by {max(tilts):.0f}° at most: tilt it by 30 to 45°, in several directions.")
    if len(tilts) < 10:
        found.append(f"{len(tilts)} photographs were used: 10 to 20 average more errors.")
    return found


def _where(x: float, y: float) -> str:
    """Return in words where a point of the image is, by its shares of width and height."""
    across = "left" if x < 0.4 else "right" if x > 0.6 else ""
    down = "top" if y < 0.4 else "bottom" if y > 0.6 else ""
    return " ".join(["at the", down, across]).strip() if across or down else "around the border"


def parameter_rows(calibration: Calibration) -> list[tuple[str, float, float]]:
    """Return name, value and σ of each parameter."""
    return [
        (name, float(value), float(sigma))
        for name, value, sigma in zip(calibration.parameters, calibration.values, calibration.sigmas, strict=True)
    ]


def write_calibration_page(path: Path, calibration: Calibration, lens: str, files: list[str]) -> None:
    """Write report.html; links lead to the files beside it."""
    camera = calibration.camera
    markers = sum(len(fit.view.xy) for fit in calibration.views)
    lead = (
        f"{lens}, {camera.width}×{camera.height} px, from {markers} markers in {len(calibration.views)} photographs; "
        f"reprojection error {calibration.rms_px:.3f} px rms. {' '.join(advice(calibration))}"
    )
    parameters = [(name, f"{value:.6g}", f"{sigma:.2g}") for name, value, sigma in parameter_rows(calibration)]
    sections = [
        Section(
            "Parameters",
            "px, pixel centres at integers; coefficients are OpenCV's. σ as the residuals tell it.",
            Table(("parameter", "value", "σ"), parameters),
        ),
        Section("Residuals over the image", image=svg_uri(_arrows(calibration)), caption=_arrow_caption(calibration)),
        Section("Coverage", image=svg_uri(_coverage_map(calibration)), caption="Markers in each cell of the image."),
        Section("Photographs", table=Table(("photograph", "markers", "rms px", "tilt °"), _view_rows(calibration))),
    ]
    if calibration.dropped:
        sections.append(Section("Left out", table=Table(("photograph", "why"), calibration.dropped)))
    write_report(path, "Calibration", lead, [*sections, Section("Files", links=files)])


def _view_rows(calibration: Calibration) -> list[tuple[str, int, float, float]]:
    return [(fit.view.name, len(fit.view.xy), fit.rms_px, tilt_deg(fit)) for fit in calibration.views]


def _errors(calibration: Calibration) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    xy = np.concatenate([fit.view.xy for fit in calibration.views])
    return xy, np.concatenate([fit.errors_px for fit in calibration.views])


def _arrow_caption(calibration: Calibration) -> str:
    _, errors = _errors(calibration)
    return f"Seen minus projected, enlarged: the longest arrow is {np.linalg.norm(errors, axis=1).max():.3f} px."


def _arrows(calibration: Calibration) -> Any:
    xy, errors = _errors(calibration)
    figure, ax = _image_axes(calibration)
    scale = _ARROW_PX / max(float(np.linalg.norm(errors, axis=1).max()), 1e-9)
    ends = errors * scale
    ax.quiver(*xy.T, *ends.T, angles="xy", scale_units="xy", scale=1, width=0.0015, color=plots.MARKER_COLOUR)
    return figure


def _coverage_map(calibration: Calibration) -> Any:
    counts = coverage(calibration)
    figure, ax = _image_axes(calibration)
    camera = calibration.camera
    extent = (-0.5, camera.width - 0.5, camera.height - 0.5, -0.5)
    ax.imshow(counts, extent=extent, cmap="Greens", vmin=0, vmax=max(1, int(counts.max())), aspect="auto")
    for row, column in np.ndindex(counts.shape):
        x, y = (column + 0.5) * camera.width / CELLS[0], (row + 0.5) * camera.height / CELLS[1]
        colour = "white" if counts[row, column] > 0.6 * counts.max() else "black"
        ax.text(x, y, str(counts[row, column]), ha="center", va="center", fontsize=8, color=colour)
    return figure


def _image_axes(calibration: Calibration) -> tuple[Any, Any]:
    camera = calibration.camera
    figure, ax = plots.new_figure(7, 7 * camera.height / camera.width)
    ax.set(xlim=(-0.5, camera.width - 0.5), ylim=(camera.height - 0.5, -0.5), xlabel="x, px", ylabel="y, px")
    return figure, ax
