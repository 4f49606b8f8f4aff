"""Markers and arrays beside ArUco and AprilTag: same printed side, same wall, same camera, same light.

Each trial hangs one sheet on a wall, renders it under one condition, and runs the detector of its design.
`write_comparison` writes rates.png, report.html and result.json.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from time import perf_counter
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray
from peaksim.camera.models import camera_named
from peaksim.camera.sensor import Sensor, capture_image
from peaksim.extras import needs_extra
from peaksim.geometry.pose import Pose, compose, invert, rotation_about, transform
from peaksim.rendering import render
from peaksim.scene import build as scene_build
from peaksim.scene.scene import Quad, Scene
from peaksim.scene.texture import Texture

from peakmark.arrays.decode import decode_arrays
from peakmark.detectors.tags import tag_detector, tag_dictionary
from peakmark.experiments.cave.rooms import photographs
from peakmark.experiments.option import check_range
from peakmark.identification.api import identify
from peakmark.markers.array_code import THREE_BIT, polarities_of
from peakmark.markers.patterns import Polarity, surf_marker
from peakmark.report import plots
from peakmark.report.page import Section, Table, svg_uri, write_report
from peakmark.report.results import result_folder, write_json

Design = Literal["SURF marker", "SURF array", "ArUco 4×4", "AprilTag 36h11"]
DESIGNS: tuple[Design, ...] = get_args(Design)
TAGS: Mapping[Design, tuple[str, int]] = {
    "ArUco 4×4": ("DICT_4X4_50", 50),
    "AprilTag 36h11": ("DICT_APRILTAG_36h11", 587),
}
"""OpenCV's name of the dictionary, and how many ids it has."""

SIDE_M = 0.05
"""Printed side of a marker and of a tag, its black border included; an array takes 2.5 × 2.5 of them."""

CAMERA = replace(camera_named("sony-dsc-s85"), width=384, height=288, cx=191.5, cy=143.5)
"""The middle of the image of the paper's second camera."""

TEXELS = 72
"""Of a marker's side: a multiple of the 9 cells of SURF's marker and of the 6 and 8 modules of the tags."""

_SHEET = 6
"""Sides of a sheet, in sides of a marker."""


@dataclass(frozen=True)
class SheetCondition:
    """How a sheet is photographed."""

    side_px: float = 40.0
    """Side of a marker in the image, as the root of its area."""
    tilt_deg: float = 0.0
    """Of the sheet against the line of sight."""
    noise: float = 2.0
    """σ of the read noise, grey levels; the exposure is 0.7."""
    blur_px: float = 0.6
    """σ of the lens blur."""
    occluded: float = 0.0
    """Share of the design's width that a grey bar covers, from its left."""


SWEEPS: dict[str, tuple[float, ...]] = {
    "side_px": (8, 10, 12, 14, 16, 20, 28, 40, 64),
    "tilt_deg": (0, 30, 45, 60, 70, 75, 80),
    "noise": (0, 5, 10, 20, 30, 40),
    "blur_px": (0.3, 1, 2, 3, 4, 6, 8),
    "occluded": (0, 0.02, 0.05, 0.1, 0.15, 0.2, 0.3),
}
"""Quantity → values; all others stay at the defaults of `SheetCondition`."""


@dataclass(frozen=True)
class Answer:
    """What a design's detector found in one image."""

    is_right: bool
    """Whether it found the sheet's design with its id (array: its code; marker: its polarity)."""
    wrong: int
    """Ids, codes or markers that are not there."""
    error_px: float | None
    """Distance of the found centre from the true one; None if not found."""
    seconds: float
    """Of the detector."""


@dataclass(frozen=True)
class DesignComparison:
    """One design under one condition."""

    quantity: str
    value: float
    """A key of `SWEEPS`, and what it was."""
    design: Design
    right: int
    trials: int
    """Trials in which it was found with its id, and all trials."""
    wrong: int
    """Ids, codes or markers that are not there, over all trials."""
    error_px_rms: float | None
    error_px_p95: float | None
    """Root mean square and 95th percentile of the centre's error; None where nothing was found."""
    seconds: float
    """Median time of the detector."""


def conditions() -> list[tuple[str, float, SheetCondition]]:
    """Return (quantity, value, condition) of all sweeps."""
    return [
        (quantity, value, replace(SheetCondition(), **{quantity: value}))
        for quantity, values in SWEEPS.items()
        for value in values
    ]


def compare_designs(trials: int, seed: int, on_condition: Callable[[], None] = lambda: None) -> list[DesignComparison]:
    """Return one row a condition and design, with counts over 1…100000 trials."""
    check_range("trials", trials, 1, 100_000)
    check_range("seed", seed, 0)
    rows = []
    for number, (quantity, value, condition) in enumerate(conditions()):
        for design in DESIGNS:
            rng = np.random.default_rng((seed, number, DESIGNS.index(design)))
            answers = [answer_trial(design, condition, rng) for _ in range(trials)]
            rows.append(_comparison(quantity, value, design, answers))
        on_condition()
    return rows


def _comparison(quantity: str, value: float, design: Design, answers: Sequence[Answer]) -> DesignComparison:
    errors = [answer.error_px for answer in answers if answer.error_px is not None]
    return DesignComparison(
        quantity,
        value,
        design,
        right=sum(answer.is_right for answer in answers),
        trials=len(answers),
        wrong=sum(answer.wrong for answer in answers),
        error_px_rms=float(np.sqrt(np.mean(np.square(errors)))) if errors else None,
        error_px_p95=float(np.percentile(errors, 95)) if errors else None,
        seconds=float(np.median([answer.seconds for answer in answers])),
    )


def answer_trial(design: Design, condition: SheetCondition, rng: np.random.Generator) -> Answer:
    """Hang a sheet with a random id on a random wall, render it, and run the design's detector."""
    code = int(rng.integers(id_count(design)))
    scene = sheet_scene(draw_sheet(design, code), width_m(design), condition, rng)
    pose = random_pose(condition, rng)
    frame = render(scene, CAMERA, pose, renderer="exact")
    gray = capture_image(frame.linear, Sensor(condition.blur_px, exposure=0.7, read_noise=condition.noise), rng)
    center = CAMERA.project(transform(invert(pose), centers_m(design))).mean(axis=0)
    start = perf_counter()
    found = find_design(design, gray)
    seconds = perf_counter() - start
    right = [xy for name, xy in found if name == code and np.linalg.norm(xy - center) <= 0.25 * condition.side_px]
    error = float(np.linalg.norm(right[0] - center)) if right else None
    return Answer(bool(right), len(found) - bool(right), error, seconds)


def id_count(design: Design) -> int:
    """Return the number of different ids: 2 polarities, 8 codes, or the size of the dictionary."""
    return {"SURF marker": 2, "SURF array": 2**THREE_BIT.bits}.get(design) or TAGS[design][1]


def find_design(design: Design, gray: NDArray[np.uint8]) -> list[tuple[int, NDArray[np.float64]]]:
    """Return (id, centre) of everything that the design's detector finds."""
    if design in TAGS:
        return [(tag.id, tag.center_xy) for tag in tag_detector(TAGS[design][0])(gray)]
    found = identify(gray)
    if design == "SURF marker":
        return [(int(d.polarity == "light"), d.xy) for d in found]
    return [(array.code, array.xy) for array in decode_arrays(found, image=gray) if array.code is not None]


# --- the sheet and the camera -------------------------------------------------------------------------------


def centers_m(design: Design) -> NDArray[np.float64]:
    """Return the (k, 3) centres of what is printed on the sheet; the design's centre is the mean of their images."""
    if design != "SURF array":
        return np.zeros((1, 3))
    cells = (np.array(THREE_BIT.cells) - 0.5) * [1, -1] * THREE_BIT.pitch * SIDE_M
    return np.pad(cells, ((0, 0), (0, 1)))


def width_m(design: Design) -> float:
    """Return the width of what is printed."""
    return SIDE_M * (1 + THREE_BIT.pitch) if design == "SURF array" else SIDE_M


def draw_sheet(design: Design, code: int) -> NDArray[np.uint8]:
    """Return a white sheet with the design in its middle."""
    paper = np.full((_SHEET * TEXELS, _SHEET * TEXELS), 255, np.uint8)
    step = THREE_BIT.pitch * TEXELS / 2
    for pattern, (x, y) in _patterns(design, code, step):
        left, top = (round((_SHEET - 1) * TEXELS / 2 + offset) for offset in (x, y))
        paper[top : top + TEXELS, left : left + TEXELS] = pattern
    return paper


def _patterns(design: Design, code: int, step: float) -> Iterator[tuple[NDArray[np.uint8], tuple[float, float]]]:
    if design in TAGS:
        yield tag_dictionary(TAGS[design][0]).generateImageMarker(code, TEXELS), (0.0, 0.0)
        return
    polarities: Sequence[Polarity] = ("light" if code else "dark",)
    cells: Sequence[tuple[float, float]] = ((0.5, 0.5),)
    if design == "SURF array":
        polarities, cells = polarities_of(code), THREE_BIT.cells
    for polarity, (column, row) in zip(polarities, cells, strict=True):
        yield surf_marker(TEXELS, polarity), ((2 * column - 1) * step, (2 * row - 1) * step)


def sheet_scene(paper: NDArray[np.uint8], width_m: float, condition: SheetCondition, rng: np.random.Generator) -> Scene:
    """Return a sheet, see `draw_sheet`, on a wall of a photograph; what is covered is a share of the width."""
    photos = photographs("held-out")
    photo = scene_build.scale_contrast(photos[str(rng.choice(list(photos)))], float(rng.uniform(0.3, 1)), 140.0)
    size, sheet_m = (2.5, 2.5), _SHEET * SIDE_M
    away = np.eye(4)
    away[2, 3] = -0.002
    wall = Quad("wall", scene_build.Paper(photo, float(rng.uniform(1.2, 2.5))).cover_surface(size, "wall"), size, away)
    quads = [wall, Quad("sheet", Texture.from_array(paper), (sheet_m, sheet_m), np.eye(4))]
    if condition.occluded > 0:
        bar = np.eye(4)
        bar[:3, 3] = (condition.occluded - 0.5) * width_m - 0.1, 0.0, 0.001
        quads.append(Quad("bar", Texture.from_array(np.full((1, 1), 110, np.uint8)), (0.2, 0.5), bar))
    return Scene(tuple(quads))


def random_pose(condition: SheetCondition, rng: np.random.Generator) -> Pose:
    """Return a camera at the condition's tilt and distance, from any side, with any roll and sub-pixel phase."""
    tilt = np.radians(condition.tilt_deg)
    distance = CAMERA.fx * SIDE_M * np.sqrt(np.cos(tilt)) / condition.side_px
    rotation = rotation_about("z", rng.uniform(0, 360)) @ rotation_about("x", condition.tilt_deg)
    rotation = rotation @ rotation_about("z", rng.uniform(0, 360)) @ np.diag([1.0, -1.0, -1.0])
    shift = rotation[:, :2] @ rng.uniform(-3, 3, 2) * distance / CAMERA.fx
    return compose(rotation, -distance * rotation[:, 2] + shift)


UNITS = {
    "side_px": "side of a marker or tag (px)",
    "tilt_deg": "tilt (°)",
    "noise": "noise σ (grey levels)",
    "blur_px": "blur σ (px)",
    "occluded": "covered share of the width",
}
HEAD = ("condition", *DESIGNS)


def write_comparison(rows: Sequence[DesignComparison], trials: int, seed: int, out: Path) -> None:
    """Write rates.png, report.html and result.json."""
    figure = rates_figure(rows)
    lead = (
        f"{trials} images a condition and design, seed {seed}. Right ids, and in brackets the number of wrong ones. "
        "Unless varied: side 40 px, no tilt, noise 2, blur 0.6 px, nothing covered; any roll, exposure 0.7. "
        "The side is that of one marker or tag; an array takes 2.5 × 2.5 of them."
    )
    sections = [
        Section("Detection rate", image=svg_uri(figure)),
        Section("Right ids (wrong ones)", table=Table(HEAD, table_rows(rows))),
        Section("Error of the centre, rms px", table=Table(HEAD, table_rows(rows, "error_px_rms"))),
        Section("Seconds in a 384×288 px image, median", table=Table(HEAD, table_rows(rows, "seconds"))),
    ]
    with result_folder(out) as folder:
        plots.save(figure, folder / "rates.png")
        write_report(folder / "report.html", "Markers, arrays, ArUco and AprilTag", lead, sections)
        write_json(folder / "result.json", {"trials": trials, "seed": seed, "rows": rows})


def table_rows(rows: Sequence[DesignComparison], figure: str | None = None) -> list[tuple[Any, ...]]:
    """Return one row a condition, one column a design: right ids with the wrong ones in brackets, or a figure."""
    cells = {(r.quantity, r.value, r.design): _counts(r) if figure is None else getattr(r, figure) for r in rows}
    return [
        (f"{UNITS[quantity]}: {value:g}", *(cells[quantity, value, design] for design in DESIGNS))
        for quantity, value, _ in conditions()
    ]


def _counts(row: DesignComparison) -> str:
    return f"{row.right}" + (f" ({row.wrong})" if row.wrong else "")


@needs_extra
def rates_figure(rows: Sequence[DesignComparison]) -> Any:
    """Return the detection rates over each quantity, one panel each."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11, 6), layout="tight")
    for k, quantity in enumerate(SWEEPS):
        ax = figure.add_subplot(2, 3, k + 1)
        for design, style in zip(DESIGNS, ("o-", "s-", "^--", "v--"), strict=True):
            chosen = [row for row in rows if (row.quantity, row.design) == (quantity, design)]
            values, rates = [r.value for r in chosen], [r.right / r.trials for r in chosen]
            ax.plot(values, rates, style, markersize=4, linewidth=1.2, label=design)
        ax.set(xlabel=UNITS[quantity], ylim=(-0.03, 1.03), ylabel="share with the right id" if k % 3 == 0 else "")
        ax.grid(alpha=0.3)
    handles, names = ax.get_legend_handles_labels()
    figure.legend(handles, names, loc="lower right", bbox_to_anchor=(0.95, 0.15), frameon=False)
    return figure
