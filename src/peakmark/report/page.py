"""One self-contained HTML page: tables, figures and images, without a network or a script."""

import base64
from collections.abc import Sequence
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from peaksim.extras import needs_extra
from PIL import Image

from peakmark.report.plots import save


@dataclass(frozen=True)
class Table:
    """A table of plain values."""

    head: Sequence[str]
    """Column titles with units."""
    rows: Sequence[Sequence[str | int | float | None]]
    """One sequence a row; numbers are aligned right."""


@dataclass(frozen=True)
class Section:
    """A titled part of the page; every part but the title may be missing."""

    title: str
    text: str = ""
    """One plain paragraph."""
    table: Table | None = None
    image: str = ""
    """A data URI from `svg_uri`, `svg_file_uri` or `jpeg_uri`."""
    caption: str = ""
    links: Sequence[str] = field(default_factory=tuple)
    """Names of files beside the page."""
    frames: Sequence[tuple[str, str]] = field(default_factory=tuple)
    """Words, and the file beside the page that they lead to: the frames behind a figure."""
    images: Sequence["CaptionedImage"] = field(default_factory=tuple)
    """Side by side where there is room."""
    data: Table | None = None
    """What a figure was drawn from, folded away."""


@dataclass(frozen=True)
class CaptionedImage:
    """An image with words under it."""

    uri: str
    """A data URI from `jpeg_uri`."""
    caption: str
    width: int
    """Of the image, px: the page reserves room for it."""
    height: int


@needs_extra
def write_report(path: Path, title: str, lead: str, sections: Sequence[Section]) -> None:
    """Write the page; all texts are escaped."""
    from jinja2 import Environment, PackageLoader

    environment = Environment(loader=PackageLoader("peakmark.report"), autoescape=True)
    environment.filters["cell"] = cell
    page = environment.get_template("report.html").render(title=title, lead=lead, sections=sections)
    path.write_text(page, encoding="utf-8")


def cell(value: str | int | float | None) -> str:
    """Format a table cell: "–" for None, at most four significant digits for fractions."""
    if value is None:
        return "–"
    if isinstance(value, float):
        return f"{value:,.0f}" if abs(value) >= 1000 else f"{value:.4g}"
    return f"{value:,}" if isinstance(value, int) else value


def markdown_table(head: Sequence[str], rows: Sequence[Sequence[str | int | float | None]]) -> str:
    """Return a table in Markdown; cells as `cell` has them."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(map(cell, line)) + " |" for line in lines)


def svg_uri(figure: Any) -> str:
    """Return a matplotlib figure as a data URI of an SVG image."""
    buffer = BytesIO()
    save(figure, buffer, "svg")
    return _uri("image/svg+xml", buffer.getvalue())


def svg_file_uri(path: Path) -> str:
    """Return an SVG file as a data URI."""
    return _uri("image/svg+xml", path.read_bytes())


def jpeg_uri(image: NDArray[np.uint8], width_px: int = 1400) -> str:
    """Return an RGB image, scaled down to `width_px` if wider, as a data URI of a JPEG."""
    small = Image.fromarray(image)
    small.thumbnail((width_px, width_px))
    buffer = BytesIO()
    small.save(buffer, "JPEG", quality=88)
    return _uri("image/jpeg", buffer.getvalue())


def _uri(kind: str, content: bytes) -> str:
    return f"data:{kind};base64,{base64.b64encode(content).decode()}"
