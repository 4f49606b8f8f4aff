"""Robotic navigation (paper, Section 4.2, Figures 10–12): a floor with a path of markers, detected and scored.

`run_floor` writes images, film, tables, report.html and result.json.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from time import perf_counter
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray
from peaksim.camera.camera import Camera
from peaksim.camera.frame import MarkerTruth, error_budget
from peaksim.camera.sensor import apply_sensor
from peaksim.rendering import opengl_or_exact
from peaksim.scene.file import Setup, load_scene
from PIL import Image

from peakmark import surf
from peakmark.errors import InputError
from peakmark.experiments.drawing import Drawing
from peakmark.experiments.floor.flight import map_of
from peakmark.experiments.floor.still_markers import DISTANCE_NOTE, marker_table
from peakmark.experiments.floor.view import FloorView, ViewRow, score_view
from peakmark.experiments.option import check_choice, check_range
from peakmark.experiments.run import OnStep
from peakmark.identification.api import Narrower
from peakmark.identification.paper import SIGNATURE_LIMIT
from peakmark.identification.stretch import LARGEST, SMALLEST
from peakmark.localise.locate import FloorMap
from peakmark.markers.patterns import IN_PLACE_OF_SURF, Made
from peakmark.plain import INLINED
from peakmark.report import plots
from peakmark.report.page import Section, Table, jpeg_uri, write_report
from peakmark.report.results import peak_memory_mb, result_folder, write_json, write_rows
from peakmark.report.views import curve_section, write_views
from peakmark.score.markers import Localisation, ScoreSummary, at_markers, localisation
from peakmark.score.wanted import IN_VIEW, SMALLEST_PX

Preset = Literal["opencv", "paper"]
PRESETS = {"opencv": surf.OPENCV, "paper": surf.PAPER}


@dataclass(frozen=True)
class FloorConfig(Drawing):
    """What to render and how to find markers."""

    scene: str = "floor"
    """Scene file, or the name of one that ships with the package."""
    texture: str | None = None
    """Variant of the texture named "floor"; None takes the first."""
    stretch: float = 2.0
    """Vertical stretch before detection."""
    frames: int = 1
    """Frames along the trajectory; 1 is taken from its first pose."""
    rule: Narrower = "paper"
    """How key points become markers."""
    preset: Preset = "opencv"
    """Of SURF: "opencv", 4 octaves × 3 layers, or "paper", 4 × 2."""
    marker: Made = "surf"
    """Markers on the floor, and the detector that finds them: "surf", or "sift" by the paper's rule."""

    def __post_init__(self) -> None:
        super().__post_init__()
        check_range("frames", self.frames, 1, 1_000_000)
        check_range("stretch", self.stretch, SMALLEST, LARGEST)
        check_choice("rule", self.rule, get_args(Narrower))
        check_choice("preset", self.preset, get_args(Preset))
        check_choice("marker", self.marker, get_args(Made))
        if self.marker == "sift" and self.rule != "paper":
            raise InputError(f"--rule: expected paper with --marker sift, got {self.rule}")


def open_scene(config: FloorConfig) -> Setup:
    """Load the configuration's scene with its floor texture and markers."""
    variants = {} if config.texture is None else {"floor": config.texture}
    setup = load_scene(config.scene, variants, IN_PLACE_OF_SURF[config.marker])
    return setup.seen_by(config.sensor)


def render_views(setup: Setup, config: FloorConfig) -> Iterator[FloorView]:
    """Yield the views of the trajectory one by one; nothing is kept between them."""
    times = setup.trajectory.times_s
    for index, time_s in enumerate(np.linspace(times[0], times[-1], config.frames)):
        yield render_view(setup, config, index, float(time_s))


def with_opengl(config: FloorConfig, camera: Camera) -> FloorConfig:
    """Return the configuration with "gl" for "auto" where OpenGL opens and can draw what the camera sees.

    This experiment is the one that shows whether OpenGL draws on a machine; elsewhere "auto" takes what is quicker.
    """
    is_open = config.renderer == "auto" and not camera.row_time_s
    return replace(config, renderer=opengl_or_exact()) if is_open else config


def render_view(setup: Setup, config: FloorConfig, index: int, time_s: float) -> FloorView:
    """Render, detect, identify and score one frame."""
    start = perf_counter()
    seeds, drawing = (config.seed, index), with_opengl(config, setup.camera)
    frame = drawing.frame(setup.scene, setup.camera, setup.trajectory, time_s, seeds)
    frame = apply_sensor(frame, setup.sensor, np.random.default_rng(seeds))
    is_refined = config.rule != "paper"  # the paper knows no refinement
    taken_s, preset = perf_counter() - start, PRESETS[config.preset]
    return score_view(index, frame, taken_s, config.stretch, config.rule, None, is_refined, config.marker, **preset)


@dataclass(frozen=True)
class Totals:
    """Sums over the frames of a trajectory."""

    markers_in_view: int
    markers_found: int
    false_detections: int
    """At no marker."""
    false_above_last_marker: int
    """Features of no marker that are stronger than the weakest marker of their frame."""
    response_drop: float | None
    """The smallest; None without any."""
    localisation_px: Localisation
    """Over all found markers."""


def totals_of(scores: Sequence[ScoreSummary], errors_px: Sequence[NDArray[np.float64]]) -> Totals:
    """Return sums of counts, the smallest drop, and the localisation from the (2,) errors of all found markers."""
    return Totals(
        markers_in_view=sum(score.markers_in_view for score in scores),
        markers_found=sum(score.markers_found for score in scores),
        false_detections=sum(score.false_detections for score in scores),
        false_above_last_marker=sum(score.false_above_last_marker or 0 for score in scores),
        response_drop=min((s.response_drop for s in scores if s.response_drop is not None), default=None),
        localisation_px=localisation(np.array(errors_px).reshape(-1, 2)),
    )


@dataclass(frozen=True)
class FloorResult:
    """What result.json holds; the fields of `score` lie at its top."""

    features: int
    """Key points; of several frames the median."""
    score: ScoreSummary | Totals = field(metadata=INLINED)
    """Of the one frame, or over all."""
    responses_above_clutter: int | None
    markers_above_clutter: int | None
    """Features that are stronger than all clutter, and the markers that they belong to; None over several frames."""
    frames: int
    renderer: str
    gl_renderer: str | None
    """"exact" or "gl", and what OpenGL calls itself; None for the exact renderer."""
    seed: int
    config: FloorConfig
    time_s: dict[str, float]
    """Seconds for "load", "render" (with the sensor), "detect" and "identify", over all frames."""
    peak_memory_mb: float | None
    remarks: tuple[str, ...] = ()
    """Why no marker was found, where none was."""


def run_floor(config: FloorConfig, out: str | Path, on_step: OnStep = lambda done, of: None) -> FloorResult:
    """Run the experiment, write everything into `out`, and return what `result.json` holds.

    `on_step` is called with the numbers of finished and of all frames, when the scene is loaded and after each frame.

    Raises
    ------
    InputError
        For a faulty configuration, scene or folder; `out` is then as it was.
    """
    start = perf_counter()
    with result_folder(out) as folder:
        setup = open_scene(config)
        load_s = perf_counter() - start
        on_step(0, config.frames)
        rows: list[ViewRow] = []
        errors_px: list[NDArray[np.float64]] = []

        def count(view: FloorView) -> None:
            rows.append(view.row())
            errors_px.extend(view.errors_px())
            on_step(len(rows), config.frames)

        film = "flight.mp4" if config.frames > 1 else None
        first, images = write_views(folder, render_views(setup, config), FloorView.overlay, figures_of, film, count)
        if config.preset == "paper":
            images["overlay"] = _write_stretched(folder, first, config.stretch)
        ranks = first.ranks() if config.frames == 1 else None
        result = FloorResult(
            features=int(np.median([row.features for row in rows])),
            score=totals_of([row.score for row in rows], errors_px) if config.frames > 1 else first.score.summary(),
            responses_above_clutter=None if ranks is None else sum(map(len, ranks.values())),
            markers_above_clutter=None if ranks is None else len(ranks),
            frames=config.frames,
            renderer=first.frame.renderer,
            gl_renderer=first.frame.gl_renderer,
            seed=config.seed,
            config=config,
            time_s={"load": load_s, **{stage: sum(row.time_s[stage] for row in rows) for stage in rows[0].time_s}},
            peak_memory_mb=peak_memory_mb(),
        )
        if result.score.markers_found == 0:
            result = replace(result, remarks=reasons(first.frame.truth, config))
        if config.frames > 1:
            write_rows(folder / "frames.csv", rows)
        _write_report(folder, first, rows, result, images, map_of(setup.scene))
        write_json(folder / "result.json", result)
    return result


def _write_stretched(folder: Path, view: FloorView, stretch: float) -> str:
    """Write the stretched image with its ranks, and return it as a data URI."""
    image = view.stretched_overlay(stretch)
    Image.fromarray(image).save(folder / "stretched.png", compress_level=1)
    return jpeg_uri(image)


def reasons(truth: Sequence[MarkerTruth], config: FloorConfig) -> tuple[str, ...]:
    """Return what may have kept the markers of a frame from being found."""
    shown = IN_VIEW.of(truth)
    if not shown:
        return ("no marker of the scene is fully in view: is the camera where [[trajectory]] should put it?",)
    sides, tilts = [t.side_px for t in shown], [t.tilt_deg for t in shown]
    lines = [f"found 0 of {len(shown)} markers with stretch {config.stretch:g}"]
    fitting = min(LARGEST, 1 / np.cos(np.deg2rad(min(float(np.median(tilts)), 89.0))))
    if not 0.75 <= config.stretch / fitting <= 1.5:
        lines.append(f"they are tilted by {min(tilts):.0f}…{max(tilts):.0f}°: try --stretch {fitting:.2g}")
    note = f", and are found reliably from {SMALLEST_PX:g} px on" if min(sides) < SMALLEST_PX else ""
    lines.append(f"their sides are {min(sides):.0f}…{max(sides):.0f} px in the image{note}")
    sought = f"{config.marker}-dark"
    if others := sorted({t.kind for t in shown} - {sought}):
        lines.append(f"only {sought} is searched for, and there are {', '.join(others)}")
    return tuple(lines)


def figures_of(view: FloorView) -> dict[str, Any]:
    """Return Figures 11 and 12."""
    is_marker = at_markers(view.frame.truth, view.found.features)
    responses, ax = plots.new_figure()
    plots.response_ranking(ax, view.found.features.response, is_marker, made_for=view.made_for)
    signatures, ax = plots.new_figure()
    plots.signature_ranking(ax, view.found.signature_distances, is_marker, SIGNATURE_LIMIT)
    return {"responses": responses, "signatures": signatures}


def _write_report(
    folder: Path,
    first: FloorView,
    rows: list[ViewRow],
    result: FloorResult,
    images: dict[str, str],
    floor_map: FloorMap | None,
) -> None:
    config, score = result.config, result.score
    found = f"{score.markers_found} of {score.markers_in_view} markers in view found"
    lead = (
        f"{found} among {result.features:,} features{' a frame' if config.frames > 1 else ''}; "
        f"scene “{config.scene}”, "
        f"floor {config.texture or 'default'}, stretch {config.stretch:g}, seed {config.seed}, "
        f"renderer {result.renderer}{' on ' + result.gl_renderer if result.gl_renderer else ''}. "
        f"{error_budget(result.renderer)}." + "".join(f" {remark[0].upper()}{remark[1:]}." for remark in result.remarks)
    )
    sections = [
        Section("Result", table=Table(("figure", "value"), result_rows(result))),
        *(_trajectory_sections(rows) if config.frames > 1 else ()),
        Section(
            "Figure 10: the frame with ranks",
            image=images["overlay"],
            caption="Circles: detections with the ranks by response among all features of those at the marker; "
            "green found, orange false, red crosses missed.",
        ),
        Section("Figure 11: responses", image=images["responses"]),
        Section("Figure 12: signatures", image=images["signatures"]),
        Section("Markers", text=DISTANCE_NOTE, table=marker_table(first, floor_map)),
    ]
    write_report(folder / "report.html", "Lab floor: markers found and scored", lead, sections)


def _trajectory_sections(rows: list[ViewRow]) -> list[Section]:
    scores, times_s = [row.score for row in rows], [row.time_on_path_s for row in rows]
    missed = [score.markers_in_view - score.markers_found for score in scores]
    return [
        curve_section("missed markers", "", times_s, missed),
        curve_section("response drop", "ratio", times_s, [score.response_drop for score in scores]),
        curve_section("localisation rms", "px", times_s, [score.localisation_px.rms for score in scores]),
        Section("Film and table", links=("flight.mp4", "frames.csv")),
    ]


def result_rows(result: FloorResult) -> list[tuple[str, Any]]:
    """Return the headline figures with units, for the report and the terminal."""
    score, times = result.score, result.time_s
    return [
        ("stretch", result.config.stretch),
        ("features", result.features),
        ("markers in view", score.markers_in_view),
        ("markers found", score.markers_found),
        ("false detections", score.false_detections),
        *_above_clutter_rows(result),
        ("features of clutter above the last marker", score.false_above_last_marker),
        ("response drop, last marker over strongest clutter", score.response_drop),
        ("localisation bias (px)", score.localisation_px.bias),
        ("localisation rms (px)", score.localisation_px.rms),
        ("localisation p95 (px)", score.localisation_px.p95),
        *((f"{stage} (s)", times[stage]) for stage in ("load", "render", "detect", "identify")),
        ("peak memory (MB)", result.peak_memory_mb),
    ]


def _above_clutter_rows(result: FloorResult) -> list[tuple[str, Any]]:
    """Return the line that the paper has as "16 highest response features for 14 present markers"."""
    if result.responses_above_clutter is None:
        return []
    text = f"{result.responses_above_clutter} for {result.markers_above_clutter} markers"
    return [("responses above all clutter", text), ("rank before the drop", result.responses_above_clutter or None)]
