"""report.html of a comparison: what got worse, the frames that show it, before and after side by side."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from peaksim.image_file import read_image

from peakmark.keypoints.image import as_gray
from peakmark.regress.compare import Change, Comparison
from peakmark.regress.frame import ScoredFrame
from peakmark.regress.outputs import SIGNS, cells_of, sentence
from peakmark.regress.record import Record
from peakmark.regress.run import IMAGE_NAME
from peakmark.report import plots
from peakmark.report.overlay import FALSE, FOUND, MISSED, draw_circle, draw_cross, rgb_copy
from peakmark.report.page import CaptionedImage, Section, Table, jpeg_uri, svg_uri, write_report

_COLOURS = {"better": "#1a7f37", "worse": "#cf222e", "changed": "#9a6700"}
_SAME_COLOUR = "#57606a"
_SHOWN_PX = 1000  # widest image


def write_page(path: Path, comparison: Comparison, images: Path) -> None:
    """Write the page; `images` is the run's folder of frames."""
    after, faults = comparison.after, comparison.faults
    changed = comparison.images_changed
    lead = [
        f"{len(faults)} of {len(comparison.changes)} figures got worse or changed." if faults else "No regression.",
        f"Detector {after.detector.name} on {len(after.results)} frames, seed {after.seed}, against a baseline of",
        f"{comparison.before.detector.name}, seed {comparison.before.seed}.",
        f"The pixels of {changed} frames differ from the baseline's." if changed else "",
    ]
    write_report(path, f"Regression: {after.suite}", " ".join(lead).strip(), [*_sections(comparison, images)])


def _sections(comparison: Comparison, images: Path) -> Iterator[Section]:
    yield Section("Figures", table=_table(comparison.changes))
    for change in comparison.faults:
        shown = [image for frame in change.frames for image in _pair(comparison, images, frame)]
        yield Section(f"{SIGNS[change.verdict]} {change.metric.key}", text=sentence(change), images=shown)
    yield Section(
        "Changes against their tolerances",
        image=svg_uri(_changes_figure(comparison.changes)),
        caption="1 is the tolerance; bars are the intervals of the change, by resampling frames in pairs.",
        data=_table(comparison.changes),
    )
    recall = [[_recall(result) for result in record.results] for record in (comparison.before, comparison.after)]
    frames = [result.frame for result in comparison.after.results]
    yield Section(
        "Markers found, frame by frame",
        image=svg_uri(_recall_figure(frames, *recall)),
        data=Table(("frame", "before", "after"), list(zip(frames, *recall, strict=True))),
    )
    yield Section("What was run", table=_origin(comparison.before, comparison.after))


def _table(changes: tuple[Change, ...]) -> Table:
    head = ("", "figure", "unit", "before", "after", "change and its interval", "tolerance", "verdict")
    return Table(
        head,
        [
            (sign, key, change.metric.unit, *values, change.verdict)
            for change in changes
            for sign, key, *values in [cells_of(change)]
        ],
    )


def _origin(before: Record, after: Record) -> Table:
    def parameters(record: Record) -> str:
        return ", ".join(f"{name} {value}" for name, value in record.detector.parameters.items()) or "–"

    rows: list[tuple[str, str | int | None, str | int]] = [
        ("detector", before.detector.name, after.detector.name),
        ("stretch", str(before.detector.stretch), str(after.detector.stretch)),
        ("parameters", parameters(before), parameters(after)),
        ("seed of the noise", before.seed, after.seed),
        ("renderer", before.renderer, after.renderer),
        *((package, before.versions.get(package), version) for package, version in after.versions.items()),
    ]
    return Table(("", "before", "after"), rows)


def _recall(result: ScoredFrame) -> float | None:
    return result.found / len(result.markers) if result.markers else None


# --- figures ------------------------------------------------------------------------------------------------------


def _changes_figure(changes: tuple[Change, ...]) -> Any:
    known = [c for c in changes if c.change is not None and c.metric.tolerance > 0]
    figure, ax = plots.new_figure(8, 1.2 + 0.32 * len(known))
    figure.subplots_adjust(left=0.3)
    for row, change in enumerate(known):
        draw_change(ax, row, change)
    ax.axvspan(-1, 1, color="#57606a", alpha=0.12, linewidth=0)
    ax.axvline(0, color="black", linewidth=0.8)
    ax.set(yticks=range(len(known)), yticklabels=[c.metric.key for c in known], ylim=(len(known) - 0.5, -0.5))
    ax.set(xlim=(-6, 6), xlabel="change / tolerance, at most ±6 shown")
    return figure


def draw_change(ax: Any, row: int, change: Change) -> None:
    """Draw a change and its interval in tolerances, cut at the figure's border."""
    colour, unit = _COLOURS.get(change.verdict, _SAME_COLOUR), change.metric.tolerance
    if change.interval is not None:
        ax.plot(np.clip(np.divide(change.interval, unit), -6, 6), [row, row], color=colour, linewidth=2)
    assert change.change is not None
    ax.plot(np.clip(change.change / unit, -5.9, 5.9), row, "o", color=colour)


def _recall_figure(frames: list[int], before: list[float | None], after: list[float | None]) -> Any:
    figure, ax = plots.new_figure(8, 2.8)
    old = {"label": "before", "color": plots.CLUTTER_COLOUR, "linewidth": 3}
    new = {"label": "after", "color": plots.MARKER_COLOUR, "linewidth": 1.2}
    for values, style in ((before, old), (after, new)):
        ax.plot(frames, np.array(values, dtype=np.float64), marker="o", markersize=3, **style)
    ax.set(xlabel="frame", ylabel="share of markers found", ylim=(-0.05, 1.05))
    ax.legend(frameon=False)
    return figure


# --- before and after -----------------------------------------------------------------------------------------


def _pair(comparison: Comparison, images: Path, frame: int) -> Iterator[CaptionedImage]:
    """Yield a frame with the baseline's detections and with the run's."""
    file = images / IMAGE_NAME.format(frame)
    if not file.is_file():
        return
    image = as_gray(read_image(file))
    records = (comparison.before, comparison.after)
    results = [next(r for r in record.results if r.frame == frame) for record in records]
    same = results[0].picture == results[1].picture
    note = "" if same else " (on the run's image; the baseline's had other pixels)"
    for result, when in zip(results, (f"before{note}", "after"), strict=True):
        drawn = draw_result(image, result)
        caption = f"Frame {frame}, {when}: {summary(result)}"
        yield CaptionedImage(jpeg_uri(drawn, _SHOWN_PX), caption, drawn.shape[1], drawn.shape[0])


def summary(result: ScoredFrame) -> str:
    """Return a frame's result in words."""
    if result.failure is not None:
        return f"no answer ({result.failure})"
    false = "" if result.false_xy is None else f", {len(result.false_xy)} false"
    return f"{result.found} of {len(result.markers)} markers found{false}, {result.features} features"


def draw_result(image: NDArray[np.uint8], result: ScoredFrame) -> NDArray[np.uint8]:
    """Return an RGB copy with found markers in green, missed ones crossed in red, false detections in orange."""
    canvas = rgb_copy(image)
    for marker in result.markers.values():
        size = max(6, round(marker.side_px * 0.75))
        if marker.xy is None:
            draw_cross(canvas, marker.true_xy, 2 * size, MISSED, 2)
        else:
            draw_circle(canvas, marker.xy, size, FOUND, 2)
    for xy in result.false_xy or ():
        draw_circle(canvas, xy, 10, FALSE, 2)
    return canvas
