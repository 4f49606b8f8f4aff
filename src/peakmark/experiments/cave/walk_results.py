"""Writes what the CAVE experiment found: images, film, tables, report.html and result.json."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray
from peaksim.camera.frame import error_budget
from peaksim.extras import needs_extra

from peakmark.arrays.decode import MarkerArray
from peakmark.experiments.cave.walk import (
    COUNTS,
    CaveConfig,
    CaveFrame,
    CaveView,
    Counts,
    array_map,
    open_cave,
    render_walk,
    total,
)
from peakmark.experiments.cave.walk_poses import WalkStep, step_of, write_walk_poses
from peakmark.plain import INLINED
from peakmark.report import plots
from peakmark.report.overlay import box_around, draw_arrays
from peakmark.report.page import Section, Table, write_report
from peakmark.report.results import peak_memory_mb, result_folder, write_json, write_rows
from peakmark.report.views import write_views
from peakmark.score.arrays import printed_arrays
from peakmark.score.markers import MarkerScore, at_markers

_MOST_CUT_OUTS = 8
"""Arrays that Figure 15 shows: two lines of four."""


@dataclass(frozen=True)
class CaveResult:
    """What `result.json` holds, the counts inlined: a frame's figures, or sums of counts and medians over several."""

    counts: Counts = field(metadata=INLINED)
    """Sums over the frames."""
    codes: list[int]
    """That were read in any frame, each once."""
    missed: list[str]
    """Names of what was not found, frame by frame."""
    pose_mm: float | None
    pose_deg: float | None
    """Median errors of the camera's position and rotation; None without any pose."""
    response_drop: float | None
    features: int
    """Medians; `features` is the number of key points."""
    rank_of_last_marker: int | None
    """Of the first frame."""
    frames: int
    time_s: dict[str, float | None]
    """Median seconds by stage."""
    config: CaveConfig
    load_s: float
    """Seconds for the scene."""
    peak_memory_mb: float | None


def run_cave(config: CaveConfig, out: str | Path, on_step: Callable[[], None] = lambda: None) -> CaveResult:
    """Render, read and score the frames, write everything into `out`, and return what `result.json` holds.

    `on_step` is called when the scene is loaded and after each frame.

    Raises
    ------
    InputError
        For a faulty configuration, scene or folder; `out` is then as it was.
    """
    start = perf_counter()
    with result_folder(out) as folder:
        setup = open_cave(config)
        load_s = perf_counter() - start
        on_step()
        records: list[CaveFrame] = []
        steps: list[WalkStep] = []

        def keep(view: CaveView) -> None:
            records.append(view.record())
            steps.append(step_of(view))
            on_step()

        film = "walk.mp4" if config.frames > 1 else None
        first, figures = write_views(folder, render_walk(setup, config), draw_view, figures_of, film, keep)
        result = summarise_frames(records, config, load_s)
        files: list[str] = []
        if config.frames > 1:
            write_rows(folder / "frames.csv", records)
            files = ["walk.mp4", "frames.csv", *write_walk_poses(folder, steps, array_map(printed_arrays(setup.scene)))]
        _write_report(folder, first, result, figures, files)
        write_json(folder / "result.json", result)
    return result


def summarise_frames(records: Sequence[CaveFrame], config: CaveConfig, load_s: float) -> CaveResult:
    """Return a frame's figures, or over several the sums of counts and the median of each error."""
    first = records[0]
    return CaveResult(
        counts=total([record.counts for record in records]),
        codes=sorted({code for record in records for code in record.codes}),
        missed=[name for record in records for name in record.missed],
        pose_mm=_median(record.pose_mm for record in records),
        pose_deg=_median(record.pose_deg for record in records),
        response_drop=_median(record.response_drop for record in records),
        features=int(np.median([record.features for record in records])),
        rank_of_last_marker=first.rank_of_last_marker,
        frames=len(records),
        time_s={stage: _median(record.time_s[stage] for record in records) for stage in first.time_s},
        config=config,
        load_s=load_s,
        peak_memory_mb=peak_memory_mb(),
    )


def _median(values: Iterable[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return float(np.median(known)) if known else None


def draw_view(view: CaveView) -> NDArray[np.uint8]:
    """Return the frame with crosses and decoded numbers (Figure 13)."""
    truth = {t.name: t.center_xy for t in view.frame.truth}
    missed = [truth[name] for name in view.markers.missed]
    return draw_arrays(view.frame.image, view.reading.found.detections, view.reading.arrays, missed)


def figures_of(view: CaveView) -> dict[str, Any]:
    """Return Figures 14 and 15."""
    return {"response_vs_vis": response_figure(view), "polarity": polarity_figure(view)}


def response_figure(view: CaveView) -> Any:
    """Return Figure 14: every feature, those that lie at a marker's centre marked, whether taken for one or not."""
    figure, ax = plots.new_figure()
    found = view.reading.found
    is_taken = np.zeros(len(found.features), dtype=bool)
    is_taken[[d.rank - 1 for d in found.detections if d.rank <= len(is_taken)]] = True
    is_marker = at_markers(view.frame.truth, found.features)
    plots.response_over_vis(ax, found.features.response, found.signature_distances, is_marker, is_taken, view.made_for)
    return figure


@needs_extra
def polarity_figure(view: CaveView) -> Any:
    """Return Figure 15: arrays cut out, with the sign of each marker; the whole frame if there is no array."""
    from matplotlib.figure import Figure

    image, detections = view.frame.image, view.reading.found.detections
    size = (image.shape[1], image.shape[0])
    parts = [_cut_out(array, size) for array in view.reading.arrays[:_MOST_CUT_OUTS]] or [("no array", (0, 0, *size))]
    columns = min(4, len(parts))
    rows = -(-len(parts) // columns)
    figure = Figure(figsize=(8, (8 / columns + 0.3) * rows), layout="constrained")
    xy, sides = np.array([d.xy for d in detections]).reshape(-1, 2), np.array([d.size for d in detections])
    is_light = np.array([d.polarity == "light" for d in detections], dtype=bool)
    for k, (title, box) in enumerate(parts):
        ax = figure.add_subplot(rows, columns, k + 1)
        plots.polarities(ax, image, box, xy, sides, is_light)
        ax.set_title(title, fontsize=10)
    return figure


def _cut_out(array: MarkerArray, size: tuple[int, int]) -> tuple[str, tuple[int, int, int, int]]:
    """Return an array's title, and the box around it in an image of (width, height)."""
    title = "unsure" if array.code is None else f"array {array.code} = {array.code:03b}"
    margin_px = 1.5 * float(np.mean([d.size for d in array.detections]))
    return title, box_around(np.array([d.xy for d in array.detections]), margin_px, size)


def _write_report(
    folder: Path, first: CaveView, result: CaveResult, figures: dict[str, str], files: Sequence[str]
) -> None:
    counts, config = result.counts, result.config
    lead = (
        f"{counts.arrays_decoded} of {counts.arrays_in_view} arrays in view decoded, {counts.wrong_codes} "
        f"wrong codes; {counts.markers_found} of {counts.markers_in_view} markers found among "
        f"{result.features:,} features{' a frame' if config.frames > 1 else ''}. Scene “{config.scene}”, renderer "
        f"{first.frame.renderer}, seed {config.seed}. {error_budget(first.frame.renderer)}. "
        f"In view: wholly visible, 20 px or larger, tilted to 45°."
    )
    sections = [
        Section("Result", table=Table(("figure", "value"), result_rows(result))),
        Section(
            "Figure 13: markers and what the arrays say",
            image=figures["overlay"],
            caption="Crosses: markers; outlines: arrays with their number, ? where unsure; red: missed.",
        ),
        Section("Figure 14: response and version-independent signature", image=figures["response_vs_vis"]),
        Section(
            "Figure 15: sign of the Laplacian",
            image=figures["polarity"],
            caption="As the paper counts it: +1 for light, −1 for dark centres.",
        ),
        Section("Markers", table=marker_table(first)),
    ]
    if files:
        sections.append(Section("Film, table and poses", links=files))
    write_report(folder / "report.html", "SIFT/SURF CAVE: arrays read and scored", lead, sections)


def marker_table(view: CaveView) -> Table:
    """Return one row a marker: truth beside what was found."""
    head = ("marker", "side (px)", "distance (m)", "tilt (°)", "found", "error (px)", "polarity", "by signature")
    return Table(head, [_marker_row(marker) for marker in view.markers.markers[:200]])


def _marker_row(m: MarkerScore) -> tuple[Any, ...]:
    words = {True: "right", False: "wrong", None: None}
    found = ("yes" if m.is_found else "no", m.error_px, words[m.is_polarity_right], words[m.is_signature_right])
    return (m.name, m.side_px, m.distance_m, m.tilt_deg, *found)


def result_rows(result: CaveResult) -> list[tuple[str, Any]]:
    """Return the headline figures with units, for the report and the terminal."""
    return [
        ("features", result.features),
        *((name.replace("_", " "), getattr(result.counts, name)) for name in COUNTS),
        ("codes read", " ".join(map(str, result.codes)) or None),
        ("rank of the last marker", result.rank_of_last_marker),
        ("response drop, last marker over strongest clutter", result.response_drop),
        ("camera position error (mm)", result.pose_mm),
        ("camera rotation error (°)", result.pose_deg),
        *((f"{stage} (s)", seconds) for stage, seconds in result.time_s.items()),
        ("peak memory (MB)", result.peak_memory_mb),
    ]
