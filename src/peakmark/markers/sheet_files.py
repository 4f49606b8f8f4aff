"""Pages of markers as PDF (fpdf2), SVG or PNG files; the same page always gives the same bytes."""

from collections.abc import Callable, Iterator, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any
from xml.sax.saxutils import escape

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from peakmark.errors import InputError
from peakmark.markers.patterns import disc_quadrant
from peakmark.markers.sheet import Page
from peakmark.markers.sheet_shapes import Box, Disc, Dog, Item, Text, dog_discs, dog_gray

FORMATS = ("pdf", "svg", "png")
"""Formats that `write` knows: PDF and SVG are vector, PNG is 8-bit, or 16-bit where a page has a DoG."""

_MM_PER_INCH = 25.4
_MAX_PIXELS = 300_000_000
"""An A3 page at the 1200 dpi of the default has 278 million."""


def write(pages: Sequence[Page], stem: Path, format: str = "pdf", dpi: float = 1200.0) -> tuple[Path, ...]:
    """Write pages of one size to `stem`.pdf, or to one SVG or PNG a page (`stem`-2.svg and so on from the second).

    `stem` is a path without suffix, whose directory is made; `format` one of `FORMATS`.

    Raises
    ------
    InputError
        If the format is unknown, or dpi gives a PNG without pixels or of more than 300 megapixels.
    """
    if format not in FORMATS:
        raise InputError(f"format: expected {', '.join(FORMATS)}, got {format!r}")
    if format == "png":
        _check_pixels(pages[0], dpi)
    stem.parent.mkdir(parents=True, exist_ok=True)
    if format == "pdf":
        path = stem.with_name(stem.name + ".pdf")
        path.write_bytes(pdf(pages))
        return (path,)
    paths = [stem.with_name(f"{stem.name}{f'-{n}' if n > 1 else ''}.{format}") for n in range(1, len(pages) + 1)]
    for page, path in zip(pages, paths, strict=True):
        if format == "svg":
            path.write_text(svg(page), encoding="utf-8")
        else:
            Image.fromarray(raster(page, dpi)).save(path, dpi=(dpi, dpi), compress_level=4)
    return tuple(paths)


def vector_items(page: Page) -> Iterator[Box | Disc | Text]:
    """Yield the page's items with every DoG as finely stepped discs."""
    for item in page.items:
        if isinstance(item, Dog):
            yield from dog_discs(item)
        else:
            yield item


def pdf(pages: Sequence[Page]) -> bytes:
    """Return the pages as one vector PDF that asks viewers not to scale it."""
    from fpdf import FPDF, ViewerPreferences

    size = (pages[0].width_mm, pages[0].height_mm)
    document = FPDF(unit="mm", format=size)
    document.set_creation_date(datetime(2009, 11, 1, tzinfo=UTC))
    document.set_title("peakmark markers")
    document.viewer_preferences = ViewerPreferences(print_scaling="None")
    document.set_auto_page_break(False)
    for page in pages:
        document.add_page()
        for item in vector_items(page):
            _draw_pdf(document, item)
    return bytes(document.output())


def _draw_pdf(document: Any, item: Box | Disc | Text) -> None:
    if isinstance(item, Text):
        document.set_text_color(0)
        document.set_font("Helvetica", size=item.height_mm * 72 / _MM_PER_INCH)
        document.text(item.x_mm, item.y_mm, item.text)
        return
    document.set_fill_color(item.gray)
    if isinstance(item, Box):
        document.rect(item.x_mm, item.y_mm, item.width_mm, item.height_mm, style="F")
    else:
        document.circle(item.x_mm, item.y_mm, item.radius_mm, style="F")


def svg(page: Page) -> str:
    """Return the page as SVG with sizes in millimetres."""
    size = f'width="{page.width_mm:g}mm" height="{page.height_mm:g}mm"'
    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        f'<svg xmlns="http://www.w3.org/2000/svg" {size} viewBox="0 0 {page.width_mm:g} {page.height_mm:g}">',
        '<rect width="100%" height="100%" fill="#fff"/>',
        *(_svg_element(item) for item in vector_items(page)),
        "</svg>",
    ]
    return "\n".join(lines) + "\n"


def _svg_element(item: Box | Disc | Text) -> str:
    if isinstance(item, Text):
        at = f'x="{item.x_mm:.4f}" y="{item.y_mm:.4f}"'
        font = f'font-family="Helvetica, Arial, sans-serif" font-size="{item.height_mm:.4f}"'
        return f'<text {at} {font} xml:space="preserve">{escape(item.text)}</text>'
    level = f"{item.gray / 2.55:.4f}%"
    fill = f'fill="rgb({level},{level},{level})"'
    if isinstance(item, Disc):
        return f'<circle cx="{item.x_mm:.4f}" cy="{item.y_mm:.4f}" r="{item.radius_mm:.4f}" {fill}/>'
    at = f'x="{item.x_mm:.4f}" y="{item.y_mm:.4f}"'
    return f'<rect {at} width="{item.width_mm:.4f}" height="{item.height_mm:.4f}" {fill}/>'


def raster(page: Page, dpi: float) -> NDArray[np.uint8] | NDArray[np.uint16]:
    """Return the page as pixels, shapes by the share of each pixel that they cover.

    uint8 of (round(height), round(width)) dots; uint16 (level · 257) where the page has a DoG.
    """
    dots = dpi / _MM_PER_INCH
    shape = (round(page.height_mm * dots), round(page.width_mm * dots))
    deep = any(isinstance(item, Dog) for item in page.items)
    canvas = np.full(shape, 65535, np.uint16) if deep else np.full(shape, 255, np.uint8)
    for item in page.items:
        left, top, cover, gray = _RASTERISERS[type(item)](item, dots)
        _blend(canvas, left, top, cover, gray * (257 if deep else 1))
    return canvas


Stamp = tuple[int, int, NDArray[np.float32], float | NDArray[np.float32]]


def _stamp_box(item: Box, dots: float) -> Stamp:
    left, across = _interval(item.x_mm * dots, item.width_mm * dots)
    top, down = _interval(item.y_mm * dots, item.height_mm * dots)
    return left, top, down[:, None] * across[None, :], item.gray


def _stamp_disc(item: Disc, dots: float) -> Stamp:
    radius = np.float64(item.radius_mm * dots)
    left, top = (int(np.floor(c * dots - radius)) for c in (item.x_mm, item.y_mm))
    count = int(np.ceil(2 * radius)) + 2
    x = (left + np.arange(count) - item.x_mm * dots) / radius
    y = (top + np.arange(count) - item.y_mm * dots) / radius
    area = disc_quadrant(x[None, :], y[:, None]) * radius**2
    return left, top, np.diff(np.diff(area, axis=0), axis=1).astype(np.float32), item.gray


def _stamp_dog(item: Dog, dots: float) -> Stamp:
    half = item.side_mm / 2
    left, top, cover, _ = _stamp_box(Box(item.x_mm - half, item.y_mm - half, item.side_mm, item.side_mm, 0), dots)
    x = (left + 0.5 + np.arange(cover.shape[1])) / dots - item.x_mm
    y = (top + 0.5 + np.arange(cover.shape[0])) / dots - item.y_mm
    radius = np.hypot(x[None, :], y[:, None])
    return left, top, cover, dog_gray(radius / item.sigma_mm, item.polarity).astype(np.float32)


def _stamp_text(item: Text, dots: float) -> Stamp:
    font = ImageFont.load_default(max(1.0, item.height_mm * dots))
    left, top, right, bottom = (int(edge) for edge in font.getbbox(item.text, anchor="ls"))
    image = Image.new("L", (right - left + 2, bottom - top + 2))
    ImageDraw.Draw(image).text((1 - left, 1 - top), item.text, fill=255, font=font, anchor="ls")
    cover = np.asarray(image, dtype=np.float32) / np.float32(255)
    return round(item.x_mm * dots) + left - 1, round(item.y_mm * dots) + top - 1, cover, 0.0


_RASTERISERS: dict[type[Item], Callable[[Any, float], Stamp]] = {
    Box: _stamp_box,
    Disc: _stamp_disc,
    Dog: _stamp_dog,
    Text: _stamp_text,
}


def _interval(start: float, length: float) -> tuple[int, NDArray[np.float32]]:
    """Return the first dot an interval touches and which share of each dot it covers."""
    first = int(np.floor(start))
    dot = np.arange(first, int(np.ceil(start + length)))
    share = np.minimum(dot + 1, start + length) - np.maximum(dot, start)
    return first, share.astype(np.float32)


def _blend(
    canvas: NDArray[Any], left: int, top: int, cover: NDArray[np.float32], gray: float | NDArray[np.float32]
) -> None:
    """Paint `gray` over the canvas where `cover` is 1, mixed where it is less, cut at the canvas's edge."""
    rows = slice(max(top, 0), min(top + cover.shape[0], canvas.shape[0]))
    columns = slice(max(left, 0), min(left + cover.shape[1], canvas.shape[1]))
    inner = (slice(rows.start - top, rows.stop - top), slice(columns.start - left, columns.stop - left))
    share = cover[inner]
    paint = gray[inner] if isinstance(gray, np.ndarray) else gray
    below = canvas[rows, columns]
    below[:] = np.rint(below + share * (paint - below.astype(np.float32)))


def _check_pixels(page: Page, dpi: float) -> None:
    width, height = page.width_mm / _MM_PER_INCH * dpi, page.height_mm / _MM_PER_INCH * dpi
    if not (dpi >= 50 and width * height <= _MAX_PIXELS):
        most = np.sqrt(_MAX_PIXELS / (page.width_mm * page.height_mm)) * _MM_PER_INCH
        size = f"{page.width_mm:g} × {page.height_mm:g} mm"
        raise InputError(f"dpi: expected 50…{most:.0f} for a page of {size}, got {dpi:g}")
