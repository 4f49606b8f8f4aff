"""Drives all paths and writes what came of it: paths.csv, top_view.png, drive.mp4, report.html and result.json.

A finished path is kept in `OUT/drives` until all are done, so that an interrupted run goes on with the next one.
"""

import json
import math
import os
from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path
from shutil import rmtree
from typing import Any

import numpy as np
from numpy.typing import NDArray
from peaksim.camera.frame import error_budget
from peaksim.geometry.floor_path import FloorPath

from peakmark.errors import InputError
from peakmark.experiments.floor.flight import Shot, map_of
from peakmark.experiments.floor.flight_course import Step, steps, ways
from peakmark.experiments.robot.drive import Course, DriveConfig, course, drive
from peakmark.experiments.robot.drive_figures import overall, path_figures
from peakmark.identification.stretch import floor_stretch
from peakmark.report import plots
from peakmark.report.film import film
from peakmark.report.overlay import draw_overlay
from peakmark.report.page import Section, Table, svg_uri, write_report
from peakmark.report.results import peak_memory_mb, result_folder, write_json, write_rows

FOLDER = "drives"
FILMED = 0
"""The path whose pictures become the film."""
_FILM_WIDTH_PX = 640
_DRAWN = 6
"""Paths of which the report shows the way."""

Records = Sequence[dict[str, Any]]

_HEAD = ("figure", "value", "low", "high", "of")
_CAPTION = "The path, where the camera truly was, and where the markers say it was."


def run(
    config: DriveConfig, out: str | Path, is_resumed: bool = False, on_path: Callable[[int], None] = lambda number: None
) -> dict[str, Any]:
    """Drive all paths, write everything into `out`, and return what `result.json` holds.

    `on_path` is called with the number of finished paths, before the first and after each.

    Raises
    ------
    InputError
        For a faulty configuration, scene or folder, and where `out` holds the drives of another configuration.
    """
    ways_to_go = [course(config, number) for number in range(config.paths)]
    store = _open_store(Path(out), config, is_resumed)
    on_path(0)
    for way in ways_to_go:
        if not (store / f"{way.number:04d}.json").is_file():
            _drive_and_keep(config, way, store)
        on_path(way.number + 1)
    drives = [json.loads((store / f"{way.number:04d}.json").read_text(encoding="utf-8")) for way in ways_to_go]
    courses = [
        steps(records, config.camera, map_of(way.setup.scene)) for way, records in zip(ways_to_go, drives, strict=True)
    ]
    result = _result(config, ways_to_go, drives, courses)
    with result_folder(out) as folder:
        _write(folder, store, ways_to_go, drives, courses, result)
    rmtree(store)
    return result


def _open_store(out: Path, config: DriveConfig, is_resumed: bool) -> Path:
    """Return the folder of finished paths, emptied unless the run is resumed."""
    store, identity = out / FOLDER, json.loads(json.dumps(asdict(config)))
    try:
        if not is_resumed:
            rmtree(store, ignore_errors=True)
        store.mkdir(parents=True, exist_ok=True)
        file = store / "drive.json"
        if not file.exists():
            _write_whole(file, json.dumps(identity))
        elif json.loads(file.read_text(encoding="utf-8")) != identity:
            raise InputError(f"--resume: {out} holds the drives of another configuration")
    except (OSError, json.JSONDecodeError) as error:
        raise InputError(f"--out {out}: expected a folder that can be written and resumed: {error}") from error
    return store


def _drive_and_keep(config: DriveConfig, way: Course, store: Path) -> None:
    if way.number == FILMED:
        unfinished = store / "unfinished.mp4"
        with film(unfinished, config.frames_per_second, _FILM_WIDTH_PX) as append:
            records = drive(config, way, lambda shot: append(_overlay(shot)))
        os.replace(unfinished, store / "drive.mp4")
    else:
        records = drive(config, way)
    _write_whole(store / f"{way.number:04d}.json", json.dumps(records))


def _overlay(shot: Shot) -> NDArray[np.uint8]:
    return draw_overlay(shot.frame.image, shot.frame.truth, shot.found.detections, shot.score)


def _write_whole(path: Path, text: str) -> None:
    unfinished = path.with_suffix(".unfinished")
    unfinished.write_text(text, encoding="utf-8")
    os.replace(unfinished, path)


def _result(
    config: DriveConfig, ways_to_go: Sequence[Course], drives: Sequence[Records], courses: Sequence[Sequence[Step]]
) -> dict[str, Any]:
    runs = [
        path_figures(config, way.path, records, found)
        for way, records, found in zip(ways_to_go, drives, courses, strict=True)
    ]
    stretch = floor_stretch(config.camera, config.mount.pitch_deg)
    return {
        **overall(runs, [record for records in drives for record in records], stretch),
        "paths": runs,
        "renderer": drives[0][0]["renderer"][0],
        "gl_renderer": drives[0][0]["renderer"][1],
        "config": asdict(config),
        "peak_memory_mb": peak_memory_mb(),
    }


def _write(
    folder: Path,
    store: Path,
    ways_to_go: Sequence[Course],
    drives: Sequence[Records],
    courses: Sequence[Sequence[Step]],
    result: dict[str, Any],
) -> None:
    write_rows(folder / "paths.csv", [{"path": number, **run} for number, run in enumerate(result["paths"])])
    os.replace(store / "drive.mp4", folder / "drive.mp4")
    figure, axes = _grid(min(_DRAWN, len(drives)))
    for ax, way, records, found in zip(axes, ways_to_go, drives, courses, strict=False):
        draw_top_view(ax, way, records, found)
    plots.save(figure, folder / "top_view.png")
    sections = [
        Section("Figures", "95 % Wilson intervals.", Table(_HEAD, result_rows(result))),
        Section("Seen from above", image=svg_uri(figure), caption=_CAPTION),
        Section("Each path", table=Table(PATH_HEAD, [path_row(k, run) for k, run in enumerate(result["paths"])])),
        Section("Cross-track error along the way", image=svg_uri(_cross_track(ways_to_go, drives))),
        Section("Files", links=["drive.mp4", "paths.csv", "top_view.png", "result.json"]),
    ]
    config = result["config"]
    lead = (
        f"{config['paths']} random paths of {config['length_m']:g} m on “{config['scene']}”, floor "
        f"{config['texture'] or 'default'}, seed {config['seed']}, renderer {result['renderer']}. "
        f"{error_budget(result['renderer'])}."
    )
    write_report(folder / "report.html", "A robot follows markers by sight", lead, sections)
    write_json(folder / "result.json", result)


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


def draw_top_view(ax: Any, way: Course, records: Records, found: Sequence[Step]) -> None:
    """Draw markers, path, the camera's true way, and the ways found with and without a map, in metres."""
    markers = map_of(way.setup.scene)
    assert markers is not None
    titles = {"truth": "camera, truth", "map": "estimate with the map", "motion": "estimate without a map"}
    lines = {
        titles[name]: np.array([[np.nan] * 2 if pose is None else pose[:2, 3] for pose in poses])
        for name, poses in ways(records, found).items()
    }
    plots.top_view(ax, markers.centers_m[:, :2], {"path": _line(way.path), **lines})
    ax.set_title(f"path {way.number}")


def _line(path: FloorPath) -> NDArray[np.float64]:
    return path.at(np.linspace(0, path.length_m, 200))


def _cross_track(ways_to_go: Sequence[Course], drives: Sequence[Records]) -> Any:
    figure, ax = plots.new_figure(8, 3.5)
    for way, records in zip(ways_to_go, drives, strict=True):
        at, left = way.path.nearest([record["state"][:2] for record in records])
        ax.plot(at, 100 * left, linewidth=0.8)
    ax.set(xlabel="arc length (m)", ylabel="left of the path (cm)")
    ax.grid(alpha=0.3)
    return figure


PATH_HEAD = (
    "path",
    "completed",
    "reached (m)",
    "cross-track rms (cm)",
    "max (cm)",
    "coasted (cm)",
    "markers seen",
    "lost",
    "found again",
    "frames",
)


def path_row(number: int, run: dict[str, Any]) -> tuple[Any, ...]:
    """Return one path's line of the table under `PATH_HEAD`."""
    return (
        number,
        "yes" if run["completed"] else "no",
        run["reached_m"],
        100 * run["cross_track_rms_m"],
        100 * run["cross_track_max_m"],
        100 * run["coasted_m"],
        run["markers_seen"],
        run["gaps"],
        run["found_again"],
        run["frames"],
    )


def result_rows(result: dict[str, Any]) -> list[tuple[Any, ...]]:
    """Return the headline figures: name, value, interval and number of cases."""

    def share(name: str, figure: dict[str, Any]) -> tuple[Any, ...]:
        return name, figure["value"], figure["low"], figure["high"], figure["of"]

    count = len(result["paths"])
    plain = {
        "cross-track error, rms (cm)": 100 * result["cross_track_rms_m"],
        "cross-track error, rms of the worst path (cm)": 100 * result["cross_track_worst_rms_m"],
        "cross-track error, largest (cm)": 100 * result["cross_track_max_m"],
        "farthest driven after the last sight of a marker (cm)": 100 * result["coasted_max_m"],
        "markers lost in full view": result["gaps"],
        "of these found again": result["found_again"],
        "wrong poses accepted": result["wrong_poses"],
        "frames a second": result["time_s"]["frames_per_second"],
    }
    return [
        share("paths completed", result["completed"]),
        share("drives that ended at rest", result["stopped"]),
        share("recall, markers ≥ 20 px after stretching", result["recall"]),
        share("precision", result["precision"]),
        *((name, value, None, None, count) for name, value in plain.items()),
    ]
