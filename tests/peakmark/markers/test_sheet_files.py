import shutil
import subprocess
from xml.etree import ElementTree

import cv2
import numpy as np
import pytest

from peakmark import marker
from peakmark.errors import InputError
from peakmark.markers.sheet import Print, array_tile, marker_tile, pages
from peakmark.markers.sheet_files import raster, svg, write

A4 = (210.0, 297.0)
DPI = 300
DOTS = DPI / 25.4

needs_poppler = pytest.mark.skipif(
    shutil.which("pdftoppm") is None, reason="needs pdftoppm: apt-get install poppler-utils"
)


def sheet(pattern="surf", limit="energy", polarity="dark", side_mm=80.0, label=""):
    return pages([marker_tile(Print(pattern, side_mm, polarity, limit))], A4, label=label)


def rasterised_pdf(laid_out, directory):
    (path,) = write(laid_out, directory / "sheet", "pdf")
    command = ["pdftoppm", "-r", str(DPI), "-gray", "-singlefile", str(path), str(directory / "page")]
    subprocess.run(command, check=True, timeout=120)
    return cv2.imread(str(directory / "page.pgm"), cv2.IMREAD_UNCHANGED)


def edges_mm(line):
    """Return where a row of dots first and last leaves white, to a fraction of a dot, in mm."""
    ink = np.flatnonzero(line < 250)
    first, last = ink[0], ink[-1]
    plateau = line[first + 2 : last - 1]
    start = first + 1 - (255.0 - line[first]) / (255.0 - plateau[0])
    end = last + (255.0 - line[last]) / (255.0 - plateau[-1])
    return start / DOTS, end / DOTS


@needs_poppler
@pytest.mark.parametrize("polarity", ["dark", "light"])
def test_pdf_prints_the_right_size_and_grey_levels(polarity, tmp_path):
    laid_out = sheet(polarity=polarity)
    image = rasterised_pdf(laid_out, tmp_path)
    assert image.shape == pytest.approx((297 * DOTS, 210 * DOTS), abs=1)
    (place,) = laid_out[0].markers
    row, column = int(place.y_mm * DOTS), int(place.x_mm * DOTS)
    for line, center in ((image[row], place.x_mm), (image[: 2 * row, column], place.y_mm)):
        start, end = edges_mm(line)
        assert end - start == pytest.approx(80.0, abs=0.1)
        assert (start + end) / 2 == pytest.approx(center, abs=0.1)
    cell = 80 / 9
    at = [np.round((c + cell * (np.arange(9) - 4)) * DOTS).astype(int) for c in (place.y_mm, place.x_mm)]
    np.testing.assert_array_equal(image[np.ix_(*at)], marker.surf_cells(polarity))


@needs_poppler
def test_pdf_scale_bar_has_the_stated_length(tmp_path):
    laid_out = sheet()
    image = rasterised_pdf(laid_out, tmp_path)
    tick_row = round((297 - 8 - 2.2 - 2 - 1) * DOTS)
    dark = 255.0 - image[tick_row]
    middle = len(dark) // 3
    centroids = [np.average(np.arange(a, b), weights=dark[a:b]) for a, b in ((0, middle), (middle, len(dark)))]
    assert np.diff(centroids)[0] / DOTS == pytest.approx(laid_out[0].scale_bar_mm, abs=0.1)


@needs_poppler
@pytest.mark.parametrize(("pattern", "limit"), [("sift", "energy"), ("sift", "range"), ("surf", "range")])
def test_pdf_and_raster_draw_the_same_page(pattern, limit, tmp_path):
    laid_out = sheet(pattern, limit)
    printed = rasterised_pdf(laid_out, tmp_path).astype(float)
    drawn = raster(laid_out[0], DPI).astype(float)
    drawn = drawn / 257 if drawn.max() > 255 else drawn
    (place,) = laid_out[0].markers
    window = tuple(slice(int((c - 42) * DOTS), int((c + 42) * DOTS)) for c in (place.y_mm, place.x_mm))
    difference = np.abs(printed[window] - drawn[window])
    assert (difference > 3).mean() < 0.004
    assert cv2.blur(difference, (9, 9)).max() < 35


@needs_poppler
def test_all_eight_arrays_print(tmp_path):
    laid_out = pages([array_tile(code, 25.0) for code in range(8)], A4)
    (path,) = write(laid_out, tmp_path / "arrays", "pdf")
    text = subprocess.run(["pdftotext", str(path), "-"], check=True, capture_output=True, text=True, timeout=60).stdout
    for code in range(8):
        assert f"array {code}, marker side 25 mm" in text
    assert "100 mm between the ticks" in text


def test_svg_is_well_formed_in_millimetres_and_escapes_its_label():
    (page,) = sheet(label='<&> "é"')
    root = ElementTree.fromstring(svg(page))
    assert root.attrib["width"] == "210mm"
    assert root.attrib["viewBox"] == "0 0 210 297"
    texts = [element.text for element in root.iter("{http://www.w3.org/2000/svg}text")]
    assert any(text.endswith('<&> "é"') for text in texts)
    boxes = list(root.iter("{http://www.w3.org/2000/svg}rect"))
    square = max(boxes[1:], key=lambda box: float(box.attrib["width"]))
    assert float(square.attrib["width"]) == pytest.approx(100)
    fills = {box.attrib["fill"] for box in boxes}
    assert {f"rgb({v / 2.55:.4f}%,{v / 2.55:.4f}%,{v / 2.55:.4f}%)" for v in (0, 128, 170, 212, 255)} <= fills


@pytest.mark.parametrize(("pattern", "dtype"), [("surf", np.uint8), ("sift", np.uint16)])
def test_png_has_the_depth_it_needs_and_reads_back_as_drawn(pattern, dtype, tmp_path):
    from PIL import Image

    laid_out = sheet(pattern)
    (path,) = write(laid_out, tmp_path / "sheet", "png", dpi=150)
    image = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    assert image.dtype == dtype
    np.testing.assert_array_equal(image, raster(laid_out[0], 150))
    assert Image.open(path).info["dpi"] == pytest.approx((150, 150), abs=0.1)
    if dtype == np.uint16:
        assert len(np.unique(image)) > 1000


@pytest.mark.parametrize("format", ["pdf", "svg", "png"])
def test_the_same_sheet_is_the_same_bytes(format, tmp_path):
    first, second = (write(sheet("sift"), tmp_path / name, format, dpi=72) for name in "ab")
    assert first[0].read_bytes() == second[0].read_bytes()


def test_pages_of_svg_are_numbered_files(tmp_path):
    laid_out = pages([marker_tile(Print("surf", 150.0))] * 3, A4)
    assert [path.name for path in write(laid_out, tmp_path / "s", "svg")] == ["s.svg", "s-2.svg", "s-3.svg"]


@pytest.mark.parametrize(("format", "dpi"), [("gif", 300), ("png", 0), ("png", 20000), ("png", float("nan"))])
def test_unknown_format_and_impossible_dpi_are_refused(format, dpi, tmp_path):
    with pytest.raises(InputError, match=r"expected .* got "):
        write(sheet(), tmp_path / "sheet", format, dpi)
    assert not list(tmp_path.iterdir())


@needs_poppler
@pytest.mark.parametrize(("width_mm", "side_mm"), [(50.0, 10.0), (60.0, 5.0), (100.0, 2.0)])
def test_the_pdf_of_a_small_page_keeps_its_margin(width_mm, side_mm, tmp_path):
    tiles = [marker_tile(Print("surf", side_mm))] * 3
    laid_out = pages(tiles, (width_mm, 80.0), label="tray 12 of the second test, printed for the robot")
    image = rasterised_pdf(laid_out, tmp_path)
    margin = round(7 * DOTS)
    ring = np.ones(image.shape, dtype=bool)
    ring[margin:-margin, margin:-margin] = False
    assert (image[ring] == 255).all()
    assert (image[~ring] < 100).any()
