"""Drives all paths and writes what came of it: paths.csv, top_view.png, drive.mp4, report.html and result.json."""

import math
import os
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from peaksim.camera.frame import error_budget
from peaksim.extras import needs_extra
from peaksim.whole_file import whole_file

from peakmark.experiments.floor.flight import map_of
from peakmark.experiments.floor.flight_report import HEAD, Row, draw_top_view
from peakmark.experiments.floor.flight_tracking import Flown, track_frames
from peakmark.experiments.journal import Journal, journal_key
from peakmark.experiments.robot.drive import DriveConfig, DriveFrame, DrivePath, build_path, drive, stretch_of
from peakmark.experiments.robot.drive_figures import DriveFigures, PathFigures, overall, path_figures
from peakmark.experiments.run import OnStep, run_items
from peakmark.plain import INLINED, from_plain, to_plain
from peakmark.report import plots
from peakmark.report.film import film
from peakmark.report.page import Section, Table, svg_uri, write_report
from peakmark.report.results import peak_memory_mb, result_folder, write_json, write_rows

FILMED = 0
"""The path whose images become the film."""

_FILM_WIDTH_PX = 640
_DRAWN = 6
"""Paths that the report shows from above."""

_FILM = "drive.mp4"
_TRAJECTORIES = ("camera, truth", "estimate with the map", "estimate without a map")
_CAPTION = "The path, where the camera truly was, and where the markers say it was."


@dataclass(frozen=True)
class Driven:
    """A path that was driven."""

    drive_path: DrivePath
    frames: list[DriveFrame]
    flown: Flown
    """The same frames, tracked and located."""


@dataclass(frozen=True)
class DriveResult:
    """What result.json holds; the figures of all drives lie at its top."""

    overall: DriveFigures = field(metadata=INLINED)
    paths: list[PathFigures]
    renderer: str
    gl_renderer: str | None
    """"exact" or "gl", and what OpenGL calls itself; None for the exact renderer."""
    config: DriveConfig
    peak_memory_mb: float | None


def run_drives(
    config: DriveConfig, out: str | Path, is_resumed: bool = False, on_step: OnStep = lambda done, of: None
) -> DriveResult:
    """Drive all paths, write everything into `out`, and return what `result.json` holds.

    `on_step` is called with the numbers of finished and of all paths, before the first and after each. An interrupted
    run leaves a journal of its finished paths in `out`; with `is_resumed` only the others are driven.

    Raises
    ------
    InputError
        For a faulty configuration, scene or folder, and where `out` holds the drives of another configuration.
    """
    paths = [build_path(config, number) for number in range(config.paths)]
    journal = Journal.open(out, journal_key(config), is_resumed)
    names = [f"{path.number:04d}" for path in paths]
    plain = run_items(journal, names, partial(_drive_path, config, paths, journal), on_step=on_step)
    drives = [_driven(config, path, frames) for path, frames in zip(paths, plain, strict=True)]
    result = _result(config, drives)
    with result_folder(out) as folder:
        _write(folder, journal.file(_FILM), drives, result)
    journal.remove()
    return result


def _drive_path(config: DriveConfig, paths: Sequence[DrivePath], journal: Journal, index: int) -> list[DriveFrame]:
    if index != FILMED:
        return drive(config, paths[index])
    with whole_file(journal.file(_FILM)) as path, film(path, config.frames_per_second, _FILM_WIDTH_PX) as append:
        return drive(config, paths[index], lambda view: append(view.overlay()))


def _driven(config: DriveConfig, drive_path: DrivePath, plain: Sequence[Any]) -> Driven:
    frames = [from_plain(DriveFrame, frame) for frame in plain]
    records, floor_map = [frame.record for frame in frames], map_of(drive_path.setup.scene)
    tracked = track_frames(records, config.camera, floor_map)
    times_s = np.array([record.time_on_path_s for record in records])
    name = f"path {drive_path.number}"
    return Driven(drive_path, frames, Flown(name, config.camera, stretch_of(config), times_s, floor_map, tracked))


def _result(config: DriveConfig, drives: Sequence[Driven]) -> DriveResult:
    paths = [path_figures(one.drive_path.path, one.frames, one.flown) for one in drives]
    records = [record for one in drives for record in one.flown.records]
    return DriveResult(
        overall=overall(paths, records, drives[0].flown.wanted),
        paths=paths,
        renderer=records[0].renderer,
        gl_renderer=records[0].gl_renderer,
        config=config,
        peak_memory_mb=peak_memory_mb(),
    )


def _write(folder: Path, finished_film: Path, drives: Sequence[Driven], result: DriveResult) -> None:
    write_rows(folder / "paths.csv", [{"path": number, **to_plain(path)} for number, path in enumerate(result.paths)])
    os.replace(finished_film, folder / _FILM)
    figure, axes = _grid(min(_DRAWN, len(drives)))
    for ax, one in zip(axes, drives, strict=False):
        path = one.drive_path.path
        draw_top_view(ax, one.flown, _TRAJECTORIES, path=path.at(np.linspace(0, path.length_m, 200)))
        ax.set_title(one.flown.name)
    plots.save(figure, folder / "top_view.png")
    sections = [
        Section("Figures", "95 % Wilson intervals.", Table(HEAD, result_rows(result))),
        Section("Seen from above", image=svg_uri(figure), caption=_CAPTION),
        Section("Each path", table=Table(PATH_HEAD, [path_row(k, path) for k, path in enumerate(result.paths)])),
        Section("Cross-track error along the path", image=svg_uri(_cross_track(drives))),
        Section("Files", links=[_FILM, "paths.csv", "top_view.png", "result.json"]),
    ]
    config = result.config
    lead = (
        f"{config.paths} random paths of {config.length_m:g} m on “{config.scene}”, floor "
        f"{config.texture or 'default'}, seed {config.seed}, renderer {result.renderer}. "
        f"{error_budget(result.renderer)}."
    )
    write_report(folder / "report.html", "A robot follows markers by sight", lead, sections)
    write_json(folder / "result.json", result)


@needs_extra
def _grid(count: int) -> tuple[Any, Any]:
    """Return a figure of at most three drawings a row, and their axes."""
    from matplotlib.figure import Figure

    columns = min(3, count)
    rows = math.ceil(count / columns)
    figure = Figure(figsize=(5 * columns, 4.6 * rows), layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False).ravel()
    for ax in axes[count:]:
        ax.set_axis_off()
    return figure, axes


def _cross_track(drives: Sequence[Driven]) -> Any:
    figure, ax = plots.new_figure(8, 3.5)
    for one in drives:
        at, left = one.drive_path.path.nearest([[frame.state.x_m, frame.state.y_m] for frame in one.frames])
        ax.plot(at, 100 * left, linewidth=0.8)
    ax.set(xlabel="arc length (m)", ylabel="left of the path (cm)")
    ax.grid(alpha=0.3)
    return figure


PATH_HEAD = (
    *("path", "completed", "reached (m)", "cross-track rms (cm)", "max (cm)", "coasted (cm)"),
    *("markers seen", "lost", "found again", "frames"),
)


def path_row(number: int, path: PathFigures) -> Row:
    """Return one path's line of the table under `PATH_HEAD`."""
    off_path_cm = (100 * path.cross_track_rms_m, 100 * path.cross_track_max_m, 100 * path.coasted_m)
    counts = (path.markers_seen, path.gaps, path.found_again, path.frames)
    return (number, "yes" if path.completed else "no", path.reached_m, *off_path_cm, *counts)


def result_rows(result: DriveResult) -> list[Row]:
    """Return the headline figures: name, value, interval and number of cases."""
    figures, count = result.overall, len(result.paths)
    plain = {
        "cross-track error, rms (cm)": 100 * figures.cross_track_rms_m,
        "cross-track error, rms of the worst path (cm)": 100 * figures.cross_track_worst_rms_m,
        "cross-track error, largest (cm)": 100 * figures.cross_track_max_m,
        "farthest driven after the last detection (cm)": 100 * figures.coasted_max_m,
        "markers lost in full view": figures.gaps,
        "of these found again": figures.found_again,
        "wrong poses accepted": figures.wrong_poses,
        "frames a second": figures.time_s["frames_per_second"],
    }
    return [
        figures.completed.row("paths completed"),
        figures.stopped.row("drives that ended at rest"),
        figures.recall.row("recall, markers ≥ 20 px after stretching"),
        figures.precision.row("precision"),
        *((name, value, None, None, count) for name, value in plain.items()),
    ]
