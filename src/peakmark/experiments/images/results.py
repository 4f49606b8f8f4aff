"""What an evaluation of images writes: result.json, misses.csv, and a page with tables, a figure and every miss."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from peakmark.experiments.images.evaluation import IDENTIFY, LEAST_PX, Evaluation
from peakmark.experiments.images.outcome import ImageOutcome
from peakmark.experiments.images.peers import PEERS
from peakmark.experiments.images.truth import ImageSet
from peakmark.report import plots
from peakmark.report.overlay import box_around, draw_circle, rgb_copy
from peakmark.report.page import CaptionedImage, Section, Table, jpeg_uri, svg_uri, write_report
from peakmark.report.results import result_folder, write_json
from peakmark.score.statistics import Rate

_MOST_CROPS = 120
"""Misses and false detections that are shown; result.json lists all."""

_CROP_PX = 220
"""Width of a crop on the page, px."""

_MISSED, _FALSE = (255, 80, 0), (200, 0, 200)
"""RGB of circles around what was missed, and around what is not there."""


@dataclass(frozen=True)
class Fault:
    """A marker that was missed, an array that was not read, or a detection of nothing."""

    what: str
    """Such as "missed: dark, 23 px, 68°"."""
    image: int
    """Index of the image."""
    file: str
    xy: tuple[float, float]
    side_px: float
    """Where in it, and how large, px."""


def faults_of(outcomes: Sequence[ImageOutcome]) -> Iterator[Fault]:
    """Yield everything that is held against `identify` and `decode_arrays`, image by image."""
    for k, outcome in enumerate(outcomes):
        for m in outcome.markers:
            if not m.is_found and m.paper != "cut" and m.side_px >= LEAST_PX:
                limit = " range" if m.limit == "range" else ""
                words = f"missed: {m.polarity}{limit}, {m.side_px:.0f} px, {m.tilt_deg:.0f}°"
                yield Fault(words + ("" if m.paper == "flat" else f", {m.paper}"), k, outcome.file, m.xy, m.side_px)
        for array in outcome.arrays:
            if array.is_whole and array.read != (array.code,):
                got = ", ".join(map(str, array.read)) or "nothing"
                yield Fault(f"array {array.code} read as {got}", k, outcome.file, array.xy, 3 * array.side_px)
        for x, y, side in outcome.false_xy:
            yield Fault(f"nothing there: {side:.0f} px", k, outcome.file, (x, y), side)


def write_evaluation(
    out: Path, folder: str, images: ImageSet, outcomes: Sequence[ImageOutcome], found: Evaluation
) -> None:
    """Write report.html, rates.png and result.json; the crops show the images themselves."""
    faults = list(faults_of(outcomes))
    figure = rates_figure(found)
    lead = (
        f"{found.images} images, {found.images_with_markers} with markers. Shares with 95 % intervals (Wilson); "
        "markers by identify and decode_arrays, AprilTags 36h11 of about the same size beside them by the peers. "
        "Flat, whole markers of 20 px and more unless a row says otherwise."
    )
    sections = [
        Section("Found", table=Table(HEAD, rate_rows(found)), image=svg_uri(figure)),
        Section("Arrays, false detections, centres, time", table=Table(FIGURES_HEAD, figure_rows(found))),
        Section(
            "Every fault",
            text=f"{len(faults)} faults" + (f", the first {_MOST_CROPS} shown." if len(faults) > _MOST_CROPS else "."),
            images=[_crop(images.read(fault.image), fault) for fault in faults[:_MOST_CROPS]],
        ),
    ]
    with result_folder(out) as stage:
        plots.save(figure, stage / "rates.png")
        write_report(stage / "report.html", f"Markers found in {Path(folder).name or folder}", lead, sections)
        write_json(stage / "result.json", {"figures": found, "faults": faults, "images": outcomes})


HEAD = ("group", "markers found", "95 %", *(f"tags: {name}" for name in PEERS))
FIGURES_HEAD = ("figure", "value", "low", "high", "of")


def rate_rows(found: Evaluation) -> list[tuple[str | None, ...]]:
    """Return one row a group: our share with its interval, then those of the peers; empty cells where there is none."""
    return [
        (
            row.group,
            _share(row.found.get(IDENTIFY)),
            _interval(row.found.get(IDENTIFY)),
            *map(_share, map(row.found.get, PEERS)),
        )
        for row in found.rows
    ]


def _share(share: Rate | None) -> str | None:
    return None if share is None or share.value is None else f"{100 * share.value:.1f} % of {share.of}"


def _interval(share: Rate | None) -> str | None:
    return None if share is None or share.low is None else f"{100 * share.low:.1f}–{100 * (share.high or 0):.1f}"


def figure_rows(found: Evaluation) -> list[tuple[Any, ...]]:
    """Return the figures beside recall, like `Rate.row`."""
    rows: list[tuple[Any, ...]] = [found.arrays_read.row("arrays read, share")]
    rows += [("wrong codes", found.wrong_codes, None, None, None)]
    rows += [("wrong polarities", found.wrong_polarities, None, None, None)]
    rows += [share.row(f"images with a false detection, {name}") for name, share in found.false_detections.items()]
    rows += [(f"false tags, {peer}", count, None, None, found.images) for peer, count in found.false_tags.items()]
    for name, errors in found.error_px.items():
        rows += [
            *errors.rows(f"centre, {name} (px)"),
            (f"centre, {name}: rms (px)", found.error_px_rms[name], None, None, errors.of),
        ]
    for name, times in found.cpu_ms.items():
        rows += times.rows(f"processor time, {name} (ms)")
    return rows


def rates_figure(found: Evaluation) -> Any:
    """Return the shares of all groups with their intervals, ours and the peers' side by side."""
    names = [IDENTIFY, *found.false_tags]
    figure, ax = plots.new_figure(8.0, 0.9 + 0.3 * len(found.rows))
    figure.subplots_adjust(left=0.3)
    for k, (name, colour) in enumerate(zip(names, ("#0969da", "#bc4c00", "#57606a"), strict=False)):
        at = [(row, share) for row, each in enumerate(found.rows) if (share := each.found.get(name)) and share.of]
        y = np.array([row for row, _ in at]) + 0.22 * (k - (len(names) - 1) / 2)
        value, low, high = (
            np.array([getattr(s, part) for _, s in at], dtype=np.float64) for part in ("value", "low", "high")
        )
        ax.errorbar(
            100 * value,
            y,
            xerr=100 * np.maximum([value - low, high - value], 0),
            fmt="o",
            ms=3.5,
            lw=1.1,
            color=colour,
            label=name,
        )
    ax.set(xlim=(-2, 102), xlabel="found (%)", ylim=(len(found.rows) - 0.4, -0.6))
    ax.set_yticks(range(len(found.rows)), [row.group for row in found.rows])
    ax.grid(alpha=0.3)
    ax.legend(frameon=False, loc="lower left", bbox_to_anchor=(0, 1), ncols=len(names))
    return figure


def _crop(gray: NDArray[np.uint8], fault: Fault) -> CaptionedImage:
    """Return the part of an image around a fault, enlarged, with a circle."""
    margin = max(1.6 * fault.side_px, 24.0)
    left, top, right, bottom = box_around(np.array([fault.xy]), margin, (gray.shape[1], gray.shape[0]))
    part = gray[top:bottom, left:right]
    scale = max(1, round(_CROP_PX / max(part.shape)))
    canvas = rgb_copy(part).repeat(scale, axis=0).repeat(scale, axis=1)
    middle = (np.array(fault.xy) - [left, top] + 0.5) * scale - 0.5
    colour = _FALSE if fault.what.startswith("nothing") else _MISSED
    draw_circle(canvas, middle, 0.75 * fault.side_px * scale, colour, 2)
    size = min(1.0, 2 * _CROP_PX / max(canvas.shape))
    caption = f"{fault.what}; {fault.file} at {fault.xy[0]:.0f}, {fault.xy[1]:.0f}"
    return CaptionedImage(
        jpeg_uri(canvas, 2 * _CROP_PX), caption, round(canvas.shape[1] * size), round(canvas.shape[0] * size)
    )
