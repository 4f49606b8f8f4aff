"""The views along a trajectory on disk: a film of all, and the images and figures of the first."""

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any, Protocol, TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray
from peaksim.camera.frame import Frame
from PIL import Image

from peakmark.report import plots
from peakmark.report.film import filmed
from peakmark.report.page import Section, jpeg_uri, svg_uri


class Framed(Protocol):
    """Whatever was found in a frame."""

    @property
    def frame(self) -> Frame:
        """After the sensor."""


AnyView = TypeVar("AnyView", bound=Framed)


def write_views(
    folder: Path,
    views: Iterable[AnyView],
    overlay: Callable[[AnyView], NDArray[np.uint8]],
    figures: Callable[[AnyView], dict[str, Any]],
    film: str | None,
    on_view: Callable[[AnyView], None],
) -> tuple[AnyView, dict[str, str]]:
    """Write frame.png, overlay.png and the figures of the first view, and a film of all overlays.

    `overlay` draws on a view's frame, (H, W, 3); `figures` makes matplotlib figures by their files' names, without
    suffix; `on_view` is called with each view when it is written. There must be a view; none is kept but the first.
    `film` names the film; None makes none. Returns the first view, and data URIs of "overlay" and each figure.
    """
    drawn = filmed(views, overlay, None if film is None else folder / film)
    first, image = next(drawn)
    _write_png(folder / "frame.png", first.frame.image)
    _write_png(folder / "overlay.png", image)
    uris = {"overlay": jpeg_uri(image)}
    for name, figure in figures(first).items():
        plots.save(figure, folder / f"{name}.png")
        uris[name] = svg_uri(figure)
    on_view(first)
    for view, _ in drawn:
        on_view(view)
    return first, uris


def _write_png(path: Path, image: NDArray[Any]) -> None:
    """Write an image of 8 or 16 bits; those with noise hardly shrink, so the quickest compression serves."""
    if image.dtype == np.uint8:
        Image.fromarray(image).save(path, compress_level=1)
    else:
        bgr = image if image.ndim == 2 else image[:, :, ::-1]
        path.write_bytes(cv2.imencode(".png", bgr, [cv2.IMWRITE_PNG_COMPRESSION, 1])[1].tobytes())


def curve_section(
    title: str, unit: str, times_s: Sequence[float], values: Sequence[float | None], files: Sequence[str] = ()
) -> Section:
    """Return a part of a page with a curve over the time of the frames; None leaves a gap.

    `files` are the frames' drawings beside the page: those of the least and of the largest value are linked.
    """
    figure, ax = plots.new_figure(8, 2.6)
    plots.figure_over_time(ax, np.array(times_s), np.array([np.nan if v is None else v for v in values]), title, unit)
    return Section(f"Over time: {title}", image=svg_uri(figure), frames=_ends(values, files))


def _ends(values: Sequence[float | None], files: Sequence[str]) -> list[tuple[str, str]]:
    """Return words and file of the frames with the least and the largest value, and of those without any."""
    known = [k for k, value in enumerate(values) if value is not None and np.isfinite(value)]
    if not files or not known:
        return []
    low, high = min(known, key=lambda k: values[k] or 0.0), max(known, key=lambda k: values[k] or 0.0)
    ends = [(f"least, {values[low]:.3g}", files[low]), (f"largest, {values[high]:.3g}", files[high])]
    first = next((k for k in range(len(values)) if k not in known), None)
    return ends if first is None else [*ends, ("first without", files[first])]
