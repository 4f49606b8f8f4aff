"""Figures: each function draws into the given matplotlib `ax` and returns nothing."""

from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from peaksim.extras import needs_extra

MARKER_COLOUR = "#1a7f37"
CLUTTER_COLOUR = "#8c959f"
LIGHT_COLOUR, DARK_COLOUR = "#ffd640", "#60beff"
_RANK = "rank of the feature by response"
_RESPONSES = {"surf": "response (determinant of the Hessian)", "sift": "response (DoG, of grey levels 0…1)"}


@needs_extra
def new_figure(width_in: float = 8.0, height_in: float = 4.5) -> tuple[Any, Any]:
    """Return a figure and its axes, drawn without a screen."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width_in, height_in))
    # fixed margins for the labels: a layout engine would draw everything twice to find them
    left, right, bottom, top = 0.85 / width_in, 1 - 0.2 / width_in, 0.6 / height_in, 1 - 0.4 / height_in
    figure.subplots_adjust(left, bottom, right, top)
    return figure, figure.subplots()


@needs_extra
def save(figure: Any, target: Path | BytesIO, kind: str | None = None) -> None:
    """Write a figure as "png" or "svg", by a path's ending unless given; the bytes depend on the figure alone."""
    import matplotlib

    kind = target.suffix[1:] if kind is None and isinstance(target, Path) else kind
    with matplotlib.rc_context({"svg.hashsalt": "peakmark"}):
        figure.savefig(target, format=kind, dpi=150, metadata={"Date" if kind == "svg" else "Software": None})


def response_ranking(
    ax: Any, responses: NDArray[np.float32], is_marker: NDArray[np.bool_], most: int = 60, made_for: str = "surf"
) -> None:
    """Draw the strongest responses of a detector, "surf" or "sift", in descending order (the paper's Figure 11)."""
    count = min(most, len(responses))
    colours = np.where(is_marker[:count], MARKER_COLOUR, CLUTTER_COLOUR)
    ax.bar(np.arange(1, count + 1), responses[:count], width=0.8, color=list(colours))
    ax.set(title=f"{made_for.upper()} responses in descending order", xlim=(0, count + 1))
    ax.set(xlabel=_RANK, ylabel=_RESPONSES[made_for])
    _legend(ax)


def signature_ranking(ax: Any, distances: NDArray[np.float32], is_marker: NDArray[np.bool_], limit: float) -> None:
    """Draw every feature's signature distance over its rank (the paper's Figure 12)."""
    rank = np.arange(1, len(distances) + 1)
    other = ~is_marker
    ax.scatter(rank[other], distances[other], s=3, color=CLUTTER_COLOUR, alpha=0.5, linewidths=0, rasterized=True)
    ax.scatter(rank[is_marker], distances[is_marker], s=28, color=MARKER_COLOUR, marker="D", zorder=3)
    ax.axhline(limit, color="black", linewidth=0.8, linestyle="--")
    corner = {"ha": "right", "va": "bottom", "transform": ax.get_yaxis_transform()}
    ax.text(0.99, limit + 0.01, f"limit {limit:g}", fontsize=8, **corner)
    ax.set(title="Signature distances", xlabel=_RANK, ylabel="distance from the ideal signature")
    ax.set(xscale="log", ylim=(0, None))
    _legend(ax)


def _legend(ax: Any) -> None:
    from matplotlib.patches import Patch

    kinds = (("at a marker's centre", MARKER_COLOUR), ("clutter", CLUTTER_COLOUR))
    ax.legend(handles=[Patch(color=colour, label=kind) for kind, colour in kinds], frameon=False)


def figure_over_time(ax: Any, x: NDArray[np.float64], y: NDArray[np.float64], label: str, unit: str) -> None:
    """Draw one figure of a flight over its frames."""
    ax.plot(x, y, color=MARKER_COLOUR, linewidth=1.2, marker="o", markersize=3)
    ax.set(xlabel="time (s)", ylabel=f"{label} ({unit})" if unit else label)
    ax.grid(alpha=0.3)


def top_view(ax: Any, markers_m: NDArray[np.float64], paths_m: dict[str, NDArray[np.float64]]) -> None:
    """Draw a floor from above: (n, 2) markers and named (k, 2) paths, metres; nan leaves a gap."""
    styles = [("black", "-", 2.5), (MARKER_COLOUR, "-", 1.2), ("#0969da", "--", 1.2), ("#bc4c00", ":", 1.2)]
    ax.scatter(*markers_m.T, s=14, marker="s", color=CLUTTER_COLOUR, label="markers")
    for (name, path), (colour, line, width) in zip(paths_m.items(), styles, strict=False):
        ax.plot(*path.T, color=colour, linestyle=line, linewidth=width, label=name)
    ax.set(xlabel="x (m)", ylabel="y (m)")
    ax.set_aspect("equal", adjustable="datalim")
    ax.grid(alpha=0.3)
    ax.legend(frameon=False, fontsize=8)


def roc(ax: Any, curves: dict[str, tuple[NDArray[np.float64], NDArray[np.float64]]], least: float = 1e-5) -> None:
    """Draw true over false positive rate, one named curve a classifier, with a logarithmic axis from `least`."""
    for name, (false_rate, true_rate) in curves.items():
        ax.plot(np.maximum(false_rate, least), true_rate, drawstyle="steps-post", linewidth=1.3, label=name)
    ax.set(xlabel="false positive rate", ylabel="true positive rate", xscale="log", xlim=(least, 1), ylim=(0, 1.01))
    ax.set(title="Classification of key points in held-out rooms")
    ax.grid(alpha=0.3)
    ax.legend(frameon=False, loc="lower right")


def reliability(
    ax: Any, stated: NDArray[np.float64], rates: NDArray[np.float64], bounds: NDArray[np.float64], threshold: float
) -> None:
    """Draw (n,) rates with bounds (n, 2) over the (n,) probabilities that were stated, and where the decision falls."""
    ax.plot([0, 1], [0, 1], color=CLUTTER_COLOUR, linewidth=1)
    errors = np.abs(bounds.T - rates)
    ax.errorbar(stated, rates, errors, fmt="o", markersize=4, color=MARKER_COLOUR, elinewidth=1)
    ax.axvline(threshold, color="black", linewidth=1, linestyle="--", label=f"threshold {threshold:.2f}")
    ax.set(title="What the search says, and how often it is so", xlabel="probability", ylabel="share that are markers")
    ax.set(xlim=(0, 1.01), ylim=(0, 1.01))
    ax.legend(frameon=False, loc="upper left")


def response_over_vis(
    ax: Any,
    responses: NDArray[np.float32],
    distances: NDArray[np.float32],
    is_marker: NDArray[np.bool_],
    is_taken: NDArray[np.bool_],
    made_for: str = "surf",
) -> None:
    """Draw responses over distances from the version-independent signature (the paper's Figure 14).

    Of (n,) features of a detector, "surf" or "sift", which lie at a marker's centre, and which identification took for
    markers.
    """
    other = {"s": 4, "color": CLUTTER_COLOUR, "marker": "o", "label": "other features", "linewidths": 0}
    again = {"s": 24, "edgecolors": MARKER_COLOUR, "facecolors": "none", "marker": "D", "linewidths": 0.8}
    marker = {"s": 30, "color": MARKER_COLOUR, "marker": "D", "label": "taken for markers", "linewidths": 0}
    wrong = {**marker, "color": "#cf222e", "label": "wrongly taken"}
    again["label"] = "also at a marker's centre: other octaves, parts"
    for chosen, style in (
        (~is_marker & ~is_taken, other),
        (is_marker & ~is_taken, again),
        (is_marker & is_taken, marker),
        (~is_marker & is_taken, wrong),
    ):
        if chosen.any():
            ax.scatter(distances[chosen], responses[chosen], rasterized=True, **style)
    ax.set(title="Detector response and version-independent signature", ylabel=_RESPONSES[made_for])
    ax.set(xlabel="distance from the version-independent signature", xlim=(0, None))
    ax.set(yscale="log", ylim=_around(responses))
    ax.legend(frameon=False)


@needs_extra
def _around(responses: NDArray[np.float32]) -> tuple[float, float]:
    """Return the ends of a logarithmic axis that holds all responses."""
    if not len(responses):
        return 1.0, 10.0
    return 0.8 * float(responses.min()), 2 * float(responses.max())


@needs_extra
def polarities(
    ax: Any,
    image: NDArray[np.uint8],
    box: tuple[int, int, int, int],
    xy: NDArray[np.float64],
    sides_px: NDArray[np.float64],
    is_light: NDArray[np.bool_],
) -> None:
    """Draw a part of an image, with the paper's sign of the Laplacian above each of (n, 2) markers (Figure 15).

    `box` is left, top, right and bottom in the image, the latter two exclusive.
    """
    from matplotlib.patheffects import withStroke

    left, top, right, bottom = box
    extent = (left - 0.5, right - 0.5, bottom - 0.5, top - 0.5)
    ax.imshow(image[top:bottom, left:right], cmap="gray", vmin=0, vmax=255, extent=extent)
    style = {"fontsize": 14, "weight": "bold", "ha": "center", "va": "bottom", "clip_on": True}
    outline = [withStroke(linewidth=2.5, foreground="black")]
    for (x, y), side, light in zip(xy, sides_px, is_light, strict=True):
        text, colour = ("+1", LIGHT_COLOUR) if light else ("−1", DARK_COLOUR)
        ax.text(x, y - 0.62 * side, text, color=colour, path_effects=outline, **style)
    ax.set_axis_off()


@needs_extra
def envelope_map(
    ax: Any,
    distance_m: NDArray[np.float64],
    tilt_deg: NDArray[np.float64],
    rate: NDArray[np.float64],
    is_inside: NDArray[np.bool_],
) -> None:
    """Draw (t, s) detection rates, one row of cells for each tilt, over (s,) distances; a dot where they suffice."""
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize
    from matplotlib.ticker import LogLocator

    lines = np.arange(len(tilt_deg))
    colours = ScalarMappable(Normalize(0, 1.3), "Greens")
    edges = np.exp(_cell_edges(np.log(distance_m))), np.arange(len(lines) + 1) - 0.5
    ax.pcolormesh(*edges, rate, cmap=colours.cmap, norm=colours.norm, edgecolors="white", linewidth=0.5)
    row, column = np.nonzero(is_inside)
    ax.scatter(distance_m[column], row, s=9, color="white")
    bar = ax.figure.colorbar(colours, ax=ax, pad=0.02, boundaries=np.linspace(0, 1, 101), ticks=np.linspace(0, 1, 6))
    bar.set_label("share detected; a dot: inside the envelope")
    ax.set(xscale="log", xlabel="distance (m)", ylabel="tilt (°)")
    ax.set_yticks(lines, [f"{tilt:g}" for tilt in tilt_deg])
    ax.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    ax.xaxis.set_major_formatter("{x:g}")
    ax.xaxis.set_minor_formatter("")


def _cell_edges(middles: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return n + 1 edges half-way between n middles; the outer two continue the spacing."""
    between = (middles[1:] + middles[:-1]) / 2
    return np.concatenate([[2 * middles[0] - between[0]], between, [2 * middles[-1] - between[-1]]])
