"""The report of a flight: its figures, their course over time, and the way seen from above."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from peaksim.camera.frame import error_budget

from peakmark.experiments.floor.flight import Flight
from peakmark.experiments.floor.flight_course import Step, ways
from peakmark.report import plots
from peakmark.report.page import Section, Table, svg_uri, write_report
from peakmark.score.plain_statistics import quantile_rows, rate_row

COURSES = (
    ("features", "", ("features",)),
    ("markers in view", "", ("markers_in_view",)),
    ("markers found", "", ("markers_found",)),
    ("false detections", "", ("false_detections",)),
    ("response drop", "ratio", ("response_drop",)),
    ("localisation rms", "px", ("localisation_px", "rms")),
    ("position error with the map", "mm", ("pose", "error_mm")),
    ("rotation error with the map", "°", ("pose", "error_deg")),
    ("position error without a map", "mm", ("motion", "error_mm")),
    ("render, with the sensor", "s", ("time_s", "render")),
    ("detect", "s", ("time_s", "detect")),
    ("identify", "s", ("time_s", "identify")),
)
"""Title, unit and place in a row of frames.csv of each curve."""


def write(
    path: Path,
    flight: Flight,
    records: Sequence[dict[str, Any]],
    course: Sequence[Step],
    rows: Sequence[dict[str, Any]],
    result: dict[str, Any],
) -> None:
    """Write report.html."""
    config = flight.config
    lead = (
        f"{len(records)} frames of “{config.trajectory}”, floor {config.texture or 'default'}, seed {config.seed}, "
        f"rule {config.rule}, renderer {result['renderer']}. "
        f"{error_budget(result['renderer'])}. {' '.join(result['remarks'])}"
    )
    sections = [
        Section(
            "Figures",
            "95 % intervals: Wilson for rates, bootstrap for quantiles.",
            Table(("figure", "value", "low", "high", "of"), result_rows(result)),
        )
    ]
    if flight.floor_map is not None:
        figure, ax = plots.new_figure(7, 7)
        draw_top_view(ax, flight, records, course)
        sections.append(Section("Seen from above", image=svg_uri(figure)))
    sections += [_breakdown(quantity, rows_of) for quantity, rows_of in result["recall_by"].items()]
    sections += [_course(title, unit, place, rows) for title, unit, place in COURSES]
    files = ("flight.mp4", "frames.csv", "detections.parquet", "truth.tum", "map.tum", "motion.tum", "result.json")
    sections.append(
        Section("Files", links=[name for name in files if (path.parent / name).exists() or name == "result.json"])
    )
    write_report(path, "Fly-through: markers found and scored", lead, sections)


def draw_top_view(ax: Any, flight: Flight, records: Sequence[dict[str, Any]], course: Sequence[Step]) -> None:
    """Draw markers, the camera's true way, and the ways found with and without the map, in metres."""
    assert flight.floor_map is not None
    titles = {"truth": "truth", "map": "with the map", "motion": "without a map"}
    places = {
        titles[name]: np.array([[np.nan] * 2 if pose is None else pose[:2, 3] for pose in poses])
        for name, poses in ways(records, course).items()
    }
    plots.top_view(ax, flight.floor_map.centers_m[:, :2], places)


def result_rows(result: dict[str, Any]) -> list[tuple[Any, ...]]:
    """Return the headline figures: name, value, interval and number of cases."""
    found = result["detection"]
    rows = [
        rate_row("recall, markers ≥ 20 px after stretching", found["recall"]),
        rate_row("precision", found["precision"]),
        ("false detections a megapixel", found["false_per_megapixel"], None, None, found["frames"]),
        rate_row("frames whose markers are uniquely detectable", found["uniquely_detectable"]),
        rate_row("frames without markers that stay silent", found["silent_without_markers"]),
        *quantile_rows("response drop", found["response_drop"]),
        *quantile_rows("localisation (px)", found["localisation_px"]),
    ]
    for name, title in (("rounded", "rounded scale"), ("scale", "scale"), ("refined", "refined shape")):
        if "distance" in result:
            rows += quantile_rows(f"distance from {title}, relative error", result["distance"][name])
    if "pose" in result:
        rows += [
            rate_row("frames located in the map, each by itself", result["pose"]["located_alone"]),
            rate_row("frames located in the map, with tracking", result["pose"]["located"]),
            ("wrong poses accepted", result["pose"]["wrong"], None, None, result["pose"]["located"]["of"]),
            *quantile_rows("position with the map (mm)", result["pose"]["position_mm"]),
            *quantile_rows("rotation with the map (°)", result["pose"]["rotation_deg"]),
        ]
    rows += [row for way in ("map", "motion") for row in _trajectory(way, result.get("motion", {}).get(way))]
    if "motion" in result:
        rows += [
            (name.replace("_", " "), result["motion"][name], None, None, None)
            for name in ("motion_lost_frames", "track_changes", "track_swaps")
        ]
    stages = ("render", "detect", "identify", "score")
    rows += [(f"{stage} (s, median)", result["time_s"][stage], None, None, None) for stage in stages]
    return [*rows, ("frames a second", result["time_s"]["frames_per_second"], None, None, None)]


def _trajectory(way: str, errors: dict[str, float] | None) -> list[tuple[Any, ...]]:
    title = "with the map" if way == "map" else "without a map"
    names = {
        "ate_rmse_mm": "ATE rmse (mm)",
        "rpe_rmse_mm": "RPE rmse (mm a frame)",
        "rpe_rmse_deg": "RPE rmse (° a frame)",
    }
    return [(f"{text} {title}", errors[name], None, None, None) for name, text in names.items()] if errors else []


def _breakdown(quantity: str, rows: Sequence[dict[str, Any]]) -> Section:
    name, unit = quantity.rsplit("_", 1)
    unit = "°" if unit == "deg" else unit
    table = [
        (
            f"{row['low']}…{row['high']}",
            row["recall"]["of"],
            row["recall"]["value"],
            row["recall"]["low"],
            row["recall"]["high"],
            row["error_px"],
        )
        for row in rows
    ]
    head = (f"{name} ({unit})", "markers", "recall", "low", "high", "localisation p50 (px)")
    return Section(f"Recall by {name}, markers fully in view", table=Table(head, table))


def _course(title: str, unit: str, place: tuple[str, ...], rows: Sequence[dict[str, Any]]) -> Section:
    def value(row: Any) -> float:
        for name in place:
            row = row[name]
        return np.nan if row is None else float(row)

    figure, ax = plots.new_figure(8, 2.6)
    plots.figure_over_time(
        ax, np.array([row["time_on_path_s"] for row in rows]), np.array([value(row) for row in rows]), title, unit
    )
    return Section(f"Course: {title}", image=svg_uri(figure))
