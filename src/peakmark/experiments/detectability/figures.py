"""Figures 1–6 of the paper: the markers, the filters, the descriptors, and examples of distortions."""

import itertools
from collections.abc import Sequence
from typing import Any, get_args

import numpy as np
from numpy.typing import NDArray
from peaksim.extras import needs_extra

from peakmark import marker
from peakmark.detectors.outcome import run_detector
from peakmark.detectors.registry import find_detector
from peakmark.experiments.detectability.conditions import Condition, render_image
from peakmark.identification.signature import INNER_CELLS, VERSION_INDEPENDENT, reference_descriptor
from peakmark.markers.optimum import Limit

COLOURS = ("#0969da", "#1a7f37", "#bc4c00", "#8250df", "#cf222e", "#57606a")
"""One a curve."""


@needs_extra
def new_figure(
    columns: int = 1, rows: int = 1, width_in: float = 8.0, height_in: float = 4.0, gap: float = 0.25
) -> tuple[Any, list[Any]]:
    """Return a figure and its axes in reading order; `gap` is between their lines, in their heights."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width_in, height_in))
    axes = list(np.ravel(figure.subplots(rows, columns)))
    # fixed margins for the labels: a layout engine would draw everything twice to find them
    figure.subplots_adjust(
        left=0.7 / width_in,
        right=1 - 0.15 / width_in,
        bottom=0.55 / height_in,
        top=1 - 0.5 / height_in,
        wspace=0.22,
        hspace=gap,
    )
    return figure, axes


def show_image(ax: Any, image: NDArray[Any], title: str = "", **settings: Any) -> None:
    """Draw a grey image without ticks."""
    ax.imshow(image, cmap="gray", interpolation="nearest", **settings)
    ax.set_title(title, fontsize=9)
    ax.set(xticks=[], yticks=[])


def figure_1() -> Any:
    """Return the markers: SIFT's, SURF's, light ones, and the binary ones of the range limit."""
    figure, axes = new_figure(4, 2, 8, 4.3)
    limits: tuple[Limit, ...] = ("energy", "range")
    polarities: tuple[marker.Polarity, ...] = ("dark", "light")
    kinds = itertools.product(limits, ("SIFT", "SURF"), polarities)
    for ax, (limit, name, polarity) in zip(axes, kinds, strict=True):
        make = marker.sift_marker if name == "SIFT" else marker.surf_marker
        pattern = make(side_px=180, polarity=polarity, limit=limit)
        show_image(ax, pattern, f"{name} {polarity}, {limit}", vmin=0, vmax=255)
    return figure


def figure_2() -> Any:
    """Return the DoG filter of SIFT as a profile."""
    figure, (ax,) = new_figure()
    x = np.linspace(-6, 6, 601)
    ratio = marker.DOG_RATIO
    ax.plot(x, np.exp(-(x**2) / 2 / ratio**2) / ratio**2 - np.exp(-(x**2) / 2), color=COLOURS[0])
    ax.axhline(0, color="black", linewidth=0.6)
    for sign in (-1, 1):
        ax.axvline(sign * marker.dog_zero_crossing(1.0), color=COLOURS[5], linewidth=0.8, linestyle="--")
    ax.set(
        xlabel="distance from the centre, σ", ylabel="G(2^⅓ σ) − G(σ), ∝", title="DoG filter; zero crossing at 1.58 σ"
    )
    return figure


def figure_3() -> Any:
    """Return SURF's box filters."""
    figure, axes = new_figure(3, 1, 8, 3)
    for ax, box, name in zip(axes, marker.surf_filters(9), ("gxx", "gyy", "gxy"), strict=True):
        show_image(ax, box, name)
    return figure


def figure_4() -> Any:
    """Return the support of the descriptors beside the markers, and the descriptors of both polarities.

    Of the light SURF marker also on white paper, where the entries that it shares with the dark one are others.
    """
    figure, axes = new_figure(2, 3, 10, 9.5, 0.35)
    _draw_supports(axes[:2])
    for ax, polarity in zip(axes[2::2], get_args(marker.Polarity), strict=True):
        title = f"SURF descriptor, {polarity}; signature in green"
        _draw_descriptor(ax, reference_descriptor(polarity), title, "dimension", (-0.6, 0.6))
    for ax, polarity in zip(axes[3::2], get_args(marker.Polarity), strict=True):
        title = f"SIFT descriptor, {polarity}; signature in green"
        _draw_descriptor(ax, _sift_descriptor(polarity), title, "dimension", (0, 0.4))
    shared = VERSION_INDEPENDENT
    for on_paper, colour, place in ((False, "black", "black"), (True, COLOURS[2], "white paper")):
        distance = vis_distance(on_paper)
        label = f"shared entries on {place}: {distance:.2g} from the dark one's"
        values = reference_descriptor("light", on_paper)[shared]
        axes[4].plot(shared + 1, values, "_", color=colour, markersize=7, markeredgewidth=2, label=label)
    axes[4].legend(frameon=False, fontsize=8, loc="lower right")
    return figure


def vis_distance(is_on_paper: bool) -> float:
    """Return how far the light marker's version-independent signature is from the dark one's, on black or white."""
    dark, light = reference_descriptor("dark"), reference_descriptor("light", is_on_paper)
    return float(np.linalg.norm((dark - light)[VERSION_INDEPENDENT]))


def _draw_supports(axes: Sequence[Any]) -> None:
    for ax, name, side, support in ((axes[0], "SURF", 9.0, 20 * 1.2), (axes[1], "SIFT", 12.0, 12.0 / np.sqrt(2))):
        make = marker.surf_marker if name == "SURF" else marker.sift_marker
        half = side / 2
        show_image(ax, make(side_px=180), f"{name} descriptor's 4 × 4 cells", extent=(-half, half, half, -half))
        lines = np.linspace(-support / 2, support / 2, 5)
        ax.hlines(lines, lines[0], lines[-1], color=COLOURS[2], linewidth=1)
        ax.vlines(lines, lines[0], lines[-1], color=COLOURS[2], linewidth=1)
        room = max(half, support / 2) * 1.05
        ax.set(xlim=(-room, room), ylim=(room, -room))


def _draw_descriptor(ax: Any, values: NDArray[Any], title: str, xlabel: str, ylim: tuple[float, float]) -> None:
    dimensions = np.arange(len(values))
    inner = np.isin(dimensions // (len(values) // 16), INNER_CELLS)
    ax.bar(dimensions + 1, values, color=np.where(inner, COLOURS[1], COLOURS[5]))
    ax.set(xlabel=xlabel, ylim=ylim)
    ax.set_title(title, fontsize=10)


def _sift_descriptor(polarity: marker.Polarity, detector: str = "sift") -> NDArray[np.float64]:
    """Return the (128,) descriptor of the SIFT marker before the grey of its rim, of unit length."""
    pattern = marker.sift_marker(polarity=polarity)
    found = find_detector(detector)(np.pad(pattern, len(pattern), mode="edge"))
    assert found.descriptors is not None
    return np.asarray(found.descriptors[0] / np.linalg.norm(found.descriptors[0].astype(np.float64)))


def sift_signature_share(detector: str = "sift") -> float:
    """Return which share of the squares of the dark SIFT marker's descriptor is in the inner four blocks."""
    blocks = _sift_descriptor("dark", detector).reshape(16, 8)
    return float((blocks[list(INNER_CELLS)] ** 2).sum())


def figure_5() -> Any:
    """Return the optimum for the 15 px kernel, under both limits."""
    figure, axes = new_figure(2, 1, 6, 3.2)
    limits: tuple[Limit, ...] = ("energy", "range")
    for ax, limit in zip(axes, limits, strict=True):
        show_image(ax, marker.surf_optimum(15, limit), f"kernel of 15 px, {limit} limit")
    return figure


def figure_6(seed: int = 0) -> Any:
    """Return examples of distorted SURF markers; the cross is where SURF puts the marker, the circle the truth."""
    figure, axes = new_figure(4, 2, 9, 4.8)
    examples = {
        "rotated by 10°": Condition(turn_deg=10),
        "tilted by 40°, 1 side away": Condition(turn_deg=0, tilt_deg=40, distance_sides=1),
        "tilted by 40°, 20 sides away": Condition(turn_deg=0, tilt_deg=40),
        "noise σ 50": Condition(turn_deg=0, noise=50),
        "defocus 12 px": Condition(turn_deg=0, defocus_px=12),
        "motion 40 px": Condition(turn_deg=0, motion_px=40),
        "JPEG quality 5": Condition(turn_deg=0, jpeg_quality=5),
        "contrast 0.25 on gravel": Condition(turn_deg=0, contrast=0.25, background="gravel"),
    }
    find = find_detector("surf-paper", describe=False)
    for ax, (title, condition) in zip(axes, examples.items(), strict=True):
        view = render_image(condition, np.random.default_rng(seed))
        show_image(ax, view.image, title, vmin=0, vmax=255)
        ax.plot(*view.center_xy, "o", markerfacecolor="none", color=COLOURS[2], markersize=9)
        found = run_detector(find, view.image).keypoints
        if len(found):
            ax.plot(*found.xy[0], "+", color="#2da44e", markersize=12, markeredgewidth=2)
        ax.set(xlim=(30, 270), ylim=(270, 30))
    return figure


def fixed_figures(seed: int = 0) -> dict[str, Any]:
    """Return figures 1 to 6, which need no measurement, by their files' stems."""
    makers = (figure_1, figure_2, figure_3, figure_4, figure_5)
    return {f"figure-{number}": make() for number, make in enumerate(makers, 1)} | {"figure-6": figure_6(seed)}
