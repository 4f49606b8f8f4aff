"""Figures 7–9 of the paper and those of the other axes: response, detection rate and error, with their intervals."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from peaksim.extras import needs_extra

from peakmark.experiments.detectability.figures import COLOURS, new_figure
from peakmark.experiments.detectability.points import sides_away
from peakmark.experiments.detectability.tables import select
from peakmark.experiments.detectability.trials import Row, Summary
from peakmark.score.wanted import TOLERANCE_PX

Curve = tuple[str, str, str]
"""Marker, detector, series."""

LABELS = {
    "scale": "side (SURF) or σ (SIFT), px",
    "turn": "in-plane rotation, °",
    "tilt": "out-of-plane rotation, °",
    "noise": "noise σ, grey levels",
    "defocus": "defocus disc's radius, px",
    "motion": "length of motion blur, px",
    "jpeg": "JPEG quality",
    "contrast": "contrast",
    "vignetting": "light lost in the corners",
    "exposure": "exposure",
    "background": "photograph: 1 gravel, 2 brick, 3 grass",
}
"""The axis of every experiment."""

_LOGARITHMIC = ("scale", "contrast", "exposure")
_SURF = [("surf-dark", "surf-paper", ""), ("surf-dark", "surf", ""), ("surf-range-dark", "surf-paper", "")]
_SIFT = [("sift-dark", "sift", ""), ("sift-dark", "vlfeat", ""), ("sift-range-dark", "sift", "")]
_FIGURES = {"scale": "figure-7", "turn": "figure-8", "tilt": "figure-9"}


def curve_figures(rows: Sequence[Row]) -> dict[str, Any]:
    """Return a figure for every measured axis, by its file's stem."""
    measured = {row.experiment for row in rows}
    return {
        _FIGURES.get(experiment, experiment): curves_figure(rows, experiment, panels_of(experiment))
        for experiment in LABELS
        if experiment in measured
    }


def panels_of(experiment: str) -> list[list[Curve]]:
    """Return the curves of an experiment's panels: SURF's, SIFT's, and VLFeat's where they would crowd these."""
    series = {
        "tilt": [sides_away(d) for d in (1, 2, 5, 20)],
        "contrast": ["uniform", "gravel"],
        "background": ["gravel", "brick", "grass"],
    }.get(experiment)
    if series is None:
        return [_SURF, _SIFT]
    pairs = (("surf-dark", "surf-paper"), ("sift-dark", "sift"), ("sift-dark", "vlfeat"))
    return [[(*pair, name) for name in series] for pair in pairs]


@needs_extra
def curves_figure(rows: Sequence[Row], experiment: str, panels: Sequence[Sequence[Curve]]) -> Any:
    """Return response, detection rate and error along one axis, a line of axes a panel."""
    from matplotlib.ticker import LogLocator

    filled = [[(c, found) for c in panel if (found := select(rows, experiment, *c))] for panel in panels]
    filled = [panel for panel in filled if panel]
    figure, axes = new_figure(3, len(filled), 12, 3.6 * len(filled), gap=0.55)
    for panel, line in zip(filled, np.reshape(axes, (-1, 3)), strict=True):
        for colour, (names, found) in zip(COLOURS, panel, strict=False):
            draw_response(line[0], found, colour, ", ".join(filter(None, names)))
            draw_rate(line[1], found, colour)
            draw_error(line[2], found, colour)
        x = [row.x for _, found in panel for row in found]
        for ax in line:
            ax.set(xlabel=LABELS[experiment])
            if experiment in _LOGARITHMIC:
                ax.set(xscale="log", xlim=(min(x) / 1.1, max(x) * 1.1))
                ax.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
                ax.xaxis.set_major_formatter("{x:g}")
                ax.xaxis.set_minor_formatter("")
            ax.grid(alpha=0.3)
        line[0].legend(frameon=False, fontsize=7)
    return figure


def draw_response(ax: Any, curve: Sequence[Row], colour: str, label: str) -> None:
    """Draw the median response over that of the undistorted marker and, over several trials, its middle 90 %.

    Dotted, the curve goes on where the key point is more than 3 px off; a dotted vertical marks from where on the RMS
    error is, as in the paper's Figure 9.
    """
    x, found = [row.x for row in curve], [row.found for row in curve]
    middle, low, high = (_ratios(found, name) for name in ("median", "p5", "p95"))
    near = np.array([one.near_response_ratio for one in found], dtype=np.float64)
    ax.plot(x, middle, color=colour, label=label, marker="o", markersize=2.5, linewidth=1.2)
    ax.plot(x, near, color=colour, linewidth=1.2, linestyle=":")
    for beyond in [row.x for row in curve if (row.found.error.rms or 0) > TOLERANCE_PX][:1]:
        ax.axvline(beyond, color=colour, linewidth=0.9, linestyle=":")
    several = _has_several_trials(curve)
    if several:
        ax.fill_between(x, low, high, color=colour, alpha=0.15, linewidth=0)
    ax.set(ylabel="response / undistorted", title="response: median and middle 90 %" if several else "response")
    ax.set_ylim(0, max(1.25, ax.get_ylim()[1]))


def _ratios(found: Sequence[Summary], name: str) -> NDArray[np.float64]:
    """Return a percentile of the response over that of the undistorted marker, nan where nothing was detected."""
    scaled = [
        one.response_ratio * getattr(one.response, name) / one.response.median if one.response_ratio else np.nan
        for one in found
    ]
    return np.array(scaled, dtype=np.float64)


def draw_rate(ax: Any, curve: Sequence[Row], colour: str) -> None:
    """Draw the rate of detection within 3 px with its interval, dashed the unique one, dotted within 0.1 side.

    One trial a point has no interval worth drawing.
    """
    x, found = [row.x for row in curve], [row.found for row in curve]
    for name, width, style in (("detected", 1.2, "-"), ("unique", 0.9, "--"), ("detected_in_sides", 0.9, ":")):
        ax.plot(x, [getattr(one, name).value for one in found], color=colour, linewidth=width, linestyle=style)
    several = _has_several_trials(curve)
    if several:
        low, high = [one.detected.low for one in found], [one.detected.high for one in found]
        ax.fill_between(x, low, high, color=colour, alpha=0.15, linewidth=0)
    title = f"found within 3 px{', with interval' if several else ''};\ndashed: uniquely; dotted: within 0.1 side"
    ax.set(ylabel="rate", title=title, ylim=(-0.03, 1.03))


def _has_several_trials(curve: Sequence[Row]) -> bool:
    return any(row.found.trials > 1 for row in curve)


def draw_error(ax: Any, curve: Sequence[Row], colour: str) -> None:
    """Draw the RMS error from the true centre and, dashed, from the projected blob's centroid."""
    found = [row for row in curve if row.found.error.rms is not None]
    x = [row.x for row in found]
    ax.plot(x, [row.found.error.rms for row in found], color=colour, linewidth=1.2)
    ax.plot(x, [row.found.blob_error.rms for row in found], color=colour, linestyle="--", linewidth=0.9)
    ax.axhline(TOLERANCE_PX, color="black", linewidth=0.8, linestyle=":")
    ax.set(ylabel="RMS error, px", title="error from the true centre;\ndashed: from the blob's", ylim=(0, 6))
