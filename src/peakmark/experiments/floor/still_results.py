"""Writes what the floor experiment found: pictures, film, tables, report.html and result.json."""

from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray
from peaksim.camera.frame import error_budget
from PIL import Image

from peakmark.experiments.floor.still import FloorConfig, Tally, View, fly, open_scene
from peakmark.identification.paper import SIGNATURE_LIMIT
from peakmark.report import plots
from peakmark.report.film import filmed
from peakmark.report.overlay import draw_overlay
from peakmark.report.page import Section, Table, jpeg_uri, svg_uri, write_report
from peakmark.report.results import peak_memory_mb, result_folder, write_json, write_rows
from peakmark.score.markers import at_markers


def run(config: FloorConfig, out: str | Path, on_step: Callable[[], None] = lambda: None) -> dict[str, Any]:
    """Run the experiment, write everything into `out`, and return what `result.json` holds.

    `on_step` is called when the scene is loaded and after each frame.

    Raises
    ------
    InputError
        For a faulty configuration, scene or folder; `out` is then as it was.
    """
    start = perf_counter()
    with result_folder(out) as folder:
        setup = open_scene(config)
        load_s = perf_counter() - start
        on_step()
        tally = Tally()
        film = folder / "flight.mp4" if config.frames > 1 else None
        for view, picture in filmed(fly(setup, config), overlay, film):
            tally.add(view)
            if view.index == 0:
                first, first_picture, figures = view, picture, write_pictures(folder, view, picture)
            on_step()
        result = _result(config, first, tally, load_s)
        if config.frames > 1:
            write_rows(folder / "frames.csv", tally.rows)
        _write_report(folder, config, first, tally, result, jpeg_uri(first_picture), figures)
        write_json(folder / "result.json", result)
    return result


def _result(config: FloorConfig, first: View, tally: Tally, load_s: float) -> dict[str, Any]:
    figures = tally.summary() if config.frames > 1 else first.row()
    for name in ("frame", "time_on_path_s", "time_s"):
        figures.pop(name, None)
    return {
        **figures,
        "frames": config.frames,
        "renderer": first.frame.renderer,
        "gl_renderer": first.frame.gl_renderer,
        "seed": config.seed,
        "config": asdict(config),
        "time_s": {"load": load_s, **tally.seconds()},
        "peak_memory_mb": peak_memory_mb(),
    }


def overlay(view: View) -> NDArray[np.uint8]:
    """Return the frame with ranks (Figure 10)."""
    return draw_overlay(view.frame.image, view.frame.truth, view.found.detections, view.score)


def write_pictures(folder: Path, view: View, picture: NDArray[np.uint8]) -> tuple[Any, Any]:
    """Write frame.png, overlay.png, responses.png and signatures.png; return the two figures."""
    # photographs with noise hardly shrink, so the quickest compression serves
    Image.fromarray(view.frame.image).save(folder / "frame.png", compress_level=1)
    Image.fromarray(picture).save(folder / "overlay.png", compress_level=1)
    figures = responses_figure(view), signatures_figure(view)
    plots.save(figures[0], folder / "responses.png")
    plots.save(figures[1], folder / "signatures.png")
    return figures


def responses_figure(view: View) -> Any:
    """Return Figure 11."""
    figure, ax = plots.new_figure()
    plots.response_ranking(ax, view.found.features.response, at_markers(view.frame.truth, view.found.features))
    return figure


def signatures_figure(view: View) -> Any:
    """Return Figure 12."""
    figure, ax = plots.new_figure()
    is_marker = at_markers(view.frame.truth, view.found.features)
    plots.signature_ranking(ax, view.found.signature_distances, is_marker, SIGNATURE_LIMIT)
    return figure


def _write_report(
    folder: Path,
    config: FloorConfig,
    first: View,
    tally: Tally,
    result: dict[str, Any],
    picture: str,
    figures: tuple[Any, Any],
) -> None:
    found = f"{result['markers_found']} of {result['markers_in_view']} markers in view found"
    lead = (
        f"{found} among {result['features']:,} features{' a frame' if config.frames > 1 else ''}; "
        f"scene “{config.scene}”, "
        f"floor {config.texture or 'default'}, stretch {config.stretch:g}, seed {config.seed}, "
        f"renderer {result['renderer']}{' on ' + result['gl_renderer'] if result['gl_renderer'] else ''}. "
        f"{error_budget(result['renderer'])}."
    )
    sections = [
        Section("Result", table=Table(("figure", "value"), result_rows(result))),
        Section(
            "Figure 10: the frame with ranks",
            image=picture,
            caption="Circles: detections with their rank by response among all features; green found, "
            "orange false, red crosses missed.",
        ),
        Section("Figure 11: responses", image=svg_uri(figures[0])),
        Section("Figure 12: signatures", image=svg_uri(figures[1])),
        Section("Markers", table=marker_table(first)),
    ]
    if config.frames > 1:
        sections[1:1] = _flight_sections(tally)
    write_report(folder / "report.html", "Lab floor: markers found and scored", lead, sections)


def _flight_sections(tally: Tally) -> list[Section]:
    def course_of(title: str, unit: str, pick: Callable[[dict[str, Any]], float | None]) -> Section:
        figure, ax = plots.new_figure(8, 2.6)
        values = np.array([np.nan if (v := pick(row)) is None else v for row in tally.rows], dtype=float)
        plots.figure_over_time(ax, np.array([row["time_on_path_s"] for row in tally.rows]), values, title, unit)
        return Section(f"Flight: {title}", image=svg_uri(figure))

    return [
        course_of("missed markers", "", lambda row: row["markers_in_view"] - row["markers_found"]),
        course_of("response drop", "ratio", lambda row: row["response_drop"]),
        course_of("localisation rms", "px", lambda row: row["localisation_px"]["rms"]),
        Section("Film and table", links=("flight.mp4", "frames.csv")),
    ]


def result_rows(result: dict[str, Any]) -> list[tuple[str, Any]]:
    """Return the headline figures with units, for the report and the terminal."""
    place, times = result["localisation_px"], result["time_s"]
    return [
        ("features", result["features"]),
        ("markers in view", result["markers_in_view"]),
        ("markers found", result["markers_found"]),
        ("false detections", result["false_detections"]),
        ("features of clutter above the last marker", result["false_above_last_marker"]),
        ("response drop, last marker over strongest clutter", result["response_drop"]),
        ("localisation bias (px)", place["bias"]),
        ("localisation rms (px)", place["rms"]),
        ("localisation p95 (px)", place["p95"]),
        *((f"{stage} (s)", times[stage]) for stage in ("load", "render", "detect", "identify")),
        ("peak memory (MB)", result["peak_memory_mb"]),
    ]


def marker_table(view: View) -> Table:
    """Return one row a marker: truth beside what was found."""
    head = ("marker", "side (px)", "distance (m)", "tilt (°)", "visible", "rank", "response", "signature", "error (px)")
    return Table(head, [_marker_row(view, t) for t in view.frame.truth])


def _marker_row(view: View, truth: Any) -> tuple[Any, ...]:
    place = (truth.name, truth.side_px, truth.distance_m, truth.tilt_deg, truth.visible_fraction)
    if truth.name not in view.score.matches:
        return (*place, None, None, None, None)
    d = view.found.detections[view.score.matches[truth.name]]
    return (*place, d.rank, d.response, d.signature_distance, float(np.linalg.norm(d.xy - truth.center_xy)))
