"""The report of a flight: its figures, curves over time, and the trajectory from above."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from peaksim.camera.frame import error_budget

from peakmark.experiments.floor.flight_figures import DetectionFigures, FlightResult, MotionFigures, PoseFigures
from peakmark.experiments.floor.flight_tracking import DISTANCES, Flown, FlownFrame
from peakmark.report import plots
from peakmark.report.page import Section, Table, svg_uri, write_report
from peakmark.report.trajectory_view import Line, positions_of, write_trajectory_view
from peakmark.report.views import curve_section
from peakmark.score.poses import TrajectoryErrors
from peakmark.score.statistics import Bin, Quantiles

Row = tuple[Any, ...]
"""Of a table: name, value, ends of the interval, cases."""

HEAD = ("figure", "value", "low", "high", "of")
INTERVALS = "95 % intervals: Wilson for rates, bootstrap for quantiles."

TRAJECTORY_PAGE = "trajectory.html"
"""The trajectories in space, beside the report where Plotly is installed."""

_FILES = (
    TRAJECTORY_PAGE,
    "flight.mp4",
    "frames.csv",
    "detections.parquet",
    "truth.tum",
    "map.tum",
    "motion.tum",
    "result.json",
)


def _of_pair(error: tuple[float, float] | None, index: int) -> float | None:
    return None if error is None else error[index]


CURVES: tuple[tuple[str, str, Callable[[FlownFrame], float | None]], ...] = (
    ("features", "", lambda frame: frame.record.features),
    ("markers in view", "", lambda frame: frame.record.score.markers_in_view),
    ("markers found", "", lambda frame: frame.record.score.markers_found),
    ("false detections", "", lambda frame: frame.record.score.false_detections),
    ("response drop", "ratio", lambda frame: frame.record.score.response_drop),
    ("localisation rms", "px", lambda frame: frame.record.score.localisation_px.rms),
    ("position error with the map", "mm", lambda frame: _of_pair(frame.map_error, 0)),
    ("rotation error with the map", "°", lambda frame: _of_pair(frame.map_error, 1)),
    ("position error without a map", "mm", lambda frame: _of_pair(frame.motion_error, 0)),
    ("render, with the sensor", "s", lambda frame: frame.record.time_s["render"]),
    ("detect", "s", lambda frame: frame.record.time_s["detect"]),
    ("identify", "s", lambda frame: frame.record.time_s["identify"]),
)
"""Title, unit and value of each curve over time."""


def write_flight_report(path: Path, flown: Flown, result: FlightResult, drawings: Sequence[str] = ()) -> None:
    """Write report.html; links lead to the files that lie beside it, and figures to the `drawings` of frames."""
    config = result.config
    lead = (
        f"{len(flown.frames)} frames of “{config.trajectory}”, floor {config.texture or 'default'}, "
        f"seed {config.seed}, rule {config.rule}, renderer {result.renderer}. "
        f"{error_budget(result.renderer)}. {' '.join(result.remarks)}"
    )
    sections = [Section("Figures", INTERVALS, Table(HEAD, result_rows(result)))]
    if flown.floor_map is not None:
        figure, ax = plots.new_figure(7, 7)
        draw_top_view(ax, flown)
        page = (TRAJECTORY_PAGE,) if (path.parent / TRAJECTORY_PAGE).exists() else ()
        sections.append(Section("Seen from above", image=svg_uri(figure), links=page))
    sections += [_breakdown(quantity, rows) for quantity, rows in result.recall_by.items()]
    times_s = [record.time_on_path_s for record in flown.records]
    sections += [
        curve_section(title, unit, times_s, [value(frame) for frame in flown.frames], drawings)
        for title, unit, value in CURVES
    ]
    links = [name for name in _FILES if (path.parent / name).exists() or name == "result.json"]
    sections.append(Section("Files", links=links))
    write_report(path, "Fly-through: markers found and scored", lead, sections)


def write_trajectory_page(path: Path, flown: Flown, drawings: Sequence[str] = ()) -> None:
    """Write the true and the found trajectories in space; a point leads to its frame's drawing where there are any."""
    assert flown.floor_map is not None
    titles = {"truth": "truth", "map": "with the map", "motion": "without a map"}
    errors = {"map": [f.map_error for f in flown.frames], "motion": [f.motion_error for f in flown.frames]}
    lines = [
        Line(titles[name], positions_of(poses), _labels(flown, errors.get(name, [None] * len(poses))))
        for name, poses in flown.trajectories.items()
        if any(pose is not None for pose in poses)
    ]
    lead = "Drag to rotate, scroll to zoom, click names to hide."
    lead += " A click on a point opens its frame." if drawings else ""
    seen = [f.located.marker_of[f.located.marker_of >= 0] for f in flown.frames if f.located is not None]
    markers_m = flown.floor_map.centers_m[np.unique(np.concatenate([np.zeros(0, np.intp), *seen]))]
    write_trajectory_view(path, "The camera's trajectory", lead, lines, markers_m, drawings)


def _labels(flown: Flown, errors: Sequence[tuple[float, float] | None]) -> list[str]:
    times = [f"frame {frame.record.frame}, {frame.record.time_on_path_s:.2f} s" for frame in flown.frames]
    offs = ["" if error is None else f"<br>{error[0]:.2f} mm, {error[1]:.3f}° off" for error in errors]
    return [time + off for time, off in zip(times, offs, strict=True)]


def draw_top_view(
    ax: Any,
    flown: Flown,
    titles: Sequence[str] = ("truth", "with the map", "without a map"),
    **others_m: NDArray[np.float64],
) -> None:
    """Draw the markers, other (k, 2) lines, and the camera's trajectories: true, found with and without the map."""
    assert flown.floor_map is not None
    lines_m = [
        np.array([[np.nan] * 2 if pose is None else pose[:2, 3] for pose in poses])
        for poses in flown.trajectories.values()
    ]
    plots.top_view(ax, flown.floor_map.centers_m[:, :2], others_m | dict(zip(titles, lines_m, strict=True)))


def result_rows(result: FlightResult) -> list[Row]:
    """Return the headline figures."""
    found = result.detection
    rows = [
        *detection_rows(found),
        found.silent_without_markers.row("frames without markers and without a detection"),
        *found.response_drop.rows("response drop"),
        *found.localisation_px.rows("localisation (px)"),
    ]
    rows += distance_rows(result.distance) if result.distance else []
    rows += pose_rows(result.pose) if result.pose else []
    rows += _motion_rows(result.motion) if result.motion else []
    stages = ("render", "detect", "identify", "score")
    rows += [(f"{stage} (s, median)", result.time_s[stage], None, None, None) for stage in stages]
    return [*rows, ("frames a second", result.time_s["frames_per_second"], None, None, None)]


def detection_rows(found: DetectionFigures) -> list[Row]:
    """Return the rows of recall, precision, false detections and unique detectability."""
    return [
        found.recall.row("recall, markers ≥ 20 px after stretching"),
        found.precision.row("precision"),
        ("false detections a megapixel", found.false_per_megapixel, None, None, found.frames),
        found.uniquely_detectable.row("frames whose markers are uniquely detectable"),
    ]


def distance_rows(distance: dict[str, Quantiles]) -> list[Row]:
    """Return the rows of the distances' relative errors."""
    titles = dict(zip(DISTANCES, ("rounded scale", "scale", "refined shape"), strict=True))
    return [
        row for name, title in titles.items() for row in distance[name].rows(f"distance from {title}, relative error")
    ]


def pose_rows(pose: PoseFigures) -> list[Row]:
    """Return the rows of what the map gave."""
    return [
        pose.located_alone.row("frames located in the map, each by itself"),
        pose.located.row("frames located in the map, with tracking"),
        ("wrong poses accepted", pose.wrong, None, None, pose.located.of),
        *pose.position_mm.rows("position with the map (mm)"),
        *pose.rotation_deg.rows("rotation with the map (°)"),
    ]


def _motion_rows(motion: MotionFigures) -> list[Row]:
    counts = {
        "motion lost frames": motion.motion_lost_frames,
        "track changes": motion.track_changes,
        "track swaps": motion.track_swaps,
    }
    return [
        *_trajectory_rows("with the map", motion.map),
        *_trajectory_rows("without a map", motion.motion),
        *((name, count, None, None, None) for name, count in counts.items()),
    ]


def _trajectory_rows(title: str, errors: TrajectoryErrors | None) -> list[Row]:
    if errors is None:
        return []
    return [
        (f"ATE rmse (mm) {title}", errors.ate_rmse_mm, None, None, None),
        (f"RPE rmse (mm a frame) {title}", errors.rpe_rmse_mm, None, None, None),
        (f"RPE rmse (° a frame) {title}", errors.rpe_rmse_deg, None, None, None),
    ]


def _breakdown(quantity: str, rows: Sequence[Bin]) -> Section:
    name, unit = quantity.rsplit("_", 1)
    unit = "°" if unit == "deg" else unit
    table = [
        (f"{row.low}…{row.high}", row.recall.of, row.recall.value, row.recall.low, row.recall.high, row.error_px[50])
        for row in rows
    ]
    head = (f"{name} ({unit})", "markers", "recall", "low", "high", "localisation p50 (px)")
    return Section(f"Recall by {name}, markers fully in view", table=Table(head, table))
