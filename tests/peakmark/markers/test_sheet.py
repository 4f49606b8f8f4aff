import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from peakmark import decode_arrays, identify, marker
from peakmark.errors import InputError
from peakmark.markers.sheet import (
    MARGIN_MM,
    SMALLEST_TEXT_MM,
    Page,
    Placed,
    Print,
    array_tile,
    marker_items,
    marker_tile,
    pages,
    paper_size,
    printable,
)
from peakmark.markers.sheet_files import raster
from peakmark.markers.sheet_shapes import Box, Text, text_length

A4 = (210.0, 297.0)


@given(
    side=st.floats(5, 90),
    border=st.floats(0, 10),
    count=st.integers(1, 40),
    paper=st.sampled_from(["a3", "a4", "letter"]),
)
def test_every_marker_is_on_its_page_once_and_apart_from_the_others(side, border, count, paper):
    laid_out = pages([marker_tile(Print("surf", side))] * count, paper_size(paper), border)
    assert sum(len(page.markers) for page in laid_out) == count
    for page in laid_out:
        centers = np.array([(m.x_mm, m.y_mm) for m in page.markers])
        reach = side / 2 + border
        assert (centers - reach >= 8).all()
        assert (centers + reach <= np.array([page.width_mm, page.height_mm]) - 8).all()
        gaps = np.abs(centers[:, None] - centers[None]).max(axis=-1)[~np.eye(len(centers), dtype=bool)]
        assert (gaps >= 2 * reach).all()


def test_pages_are_filled_before_another_is_begun():
    laid_out = pages([marker_tile(Print("surf", 30.0))] * 25, A4, border_mm=0)
    assert [len(page.markers) for page in laid_out] == [24, 1]


@pytest.mark.parametrize("code", range(8))
def test_array_leaves_the_upper_left_blank_and_carries_its_bits_in_the_papers_order(code):
    markers = array_tile(code, side_mm=30, gap_mm=10).markers
    assert {(m.x_mm, m.y_mm) for m in markers} == {(55, 15), (15, 55), (55, 55)}
    top = min(markers, key=lambda m: m.y_mm)
    left = min(markers, key=lambda m: m.x_mm)
    (rest,) = (m for m in markers if m is not top and m is not left)
    bits = [int(m.marker.polarity == "light") for m in (top, left, rest)]
    assert bits == [code >> 2 & 1, code >> 1 & 1, code & 1]


@pytest.mark.parametrize("polarity", ["dark", "light"])
@pytest.mark.parametrize("limit", ["energy", "range"])
def test_boxes_of_the_surf_marker_paint_its_cells(polarity, limit):
    painted = np.full((9, 9), -1.0)
    for box in marker_items(Placed(Print("surf", 9.0, polarity, limit), 4.5, 4.5)):
        assert isinstance(box, Box)
        edges = [box.x_mm, box.x_mm + box.width_mm, box.y_mm, box.y_mm + box.height_mm]
        left, right, top, bottom = (round(edge) for edge in edges)
        assert edges == pytest.approx([left, right, top, bottom])
        painted[top:bottom, left:right] = box.gray
    np.testing.assert_array_equal(painted, marker.surf_cells(polarity, limit))


@pytest.mark.parametrize("polarity", ["dark", "light"])
def test_printed_sift_marker_is_the_one_of_marker(polarity):
    """At 25.4 dpi a millimetre is a dot: a sheet's 181 mm DoG is `sift_marker`'s image, area-sampled."""
    (page,) = pages([marker_tile(Print("sift", 181.0, polarity))], (301.0, 300.0), border_mm=0)
    (place,) = page.markers
    left, top = (round(c - 90.5) for c in (place.x_mm, place.y_mm))
    assert (place.x_mm, place.y_mm) == (left + 90.5, top + 90.5)
    sheet = raster(page, 25.4)[top : top + 181, left : left + 181] / 257
    expected = marker.sift_marker(181 / 12, 181, polarity)
    assert np.abs(sheet - expected).max() < 1.5


@pytest.mark.parametrize(
    "call",
    [
        lambda: marker_tile(Print("orb", 80.0)),
        lambda: marker_tile(Print("surf", 0.0)),
        lambda: marker_tile(Print("surf", float("nan"))),
        lambda: array_tile(8, 30.0),
        lambda: array_tile(0, 30.0, gap_mm=-1.0),
        lambda: pages([marker_tile(Print("surf", 190.0))], A4),
        lambda: pages([marker_tile(Print("surf", 80.0))], A4, border_mm=-1.0),
        lambda: pages([marker_tile(Print("surf", 80.0))], A4, label="a\nb"),
        lambda: paper_size("b9"),
        lambda: paper_size("10x10"),
        lambda: paper_size("nanxnan"),
        lambda: printable("日本"),
        lambda: printable("x" * 81),
    ],
)
def test_what_cannot_be_printed_is_refused_in_one_line(call):
    with pytest.raises(InputError, match=r"expected .* got ") as caught:
        call()
    assert "\n" not in str(caught.value)


def test_a_marker_larger_than_the_page_is_told_the_largest_size():
    with pytest.raises(InputError, match=r"at most 185 mm .* 210 × 297 mm, got 200 mm"):
        pages([marker_tile(Print("surf", 190.0))], A4, border_mm=5)
    assert pages([marker_tile(Print("surf", 175.0))], A4, border_mm=5)


@settings(deadline=None)
@given(side=st.floats(20, 60), x=st.floats(40, 60), y=st.floats(40, 60), dpi=st.sampled_from([90.0, 150.0]))
def test_raster_keeps_position_and_ink_of_a_marker_at_any_phase(side, x, y, dpi):
    place = Placed(Print("surf", side, "dark", "range"), x, y)
    page = Page(100.0, 100.0, 50.0, marker_items(place), (place,))
    ink = 255.0 - raster(page, dpi)
    dots = dpi / 25.4
    assert ink.sum() / 255 == pytest.approx(21 * (side / 9 * dots) ** 2, rel=0.01)
    rows, columns = np.indices(ink.shape)
    assert (ink * (columns + 0.5)).sum() / ink.sum() / dots == pytest.approx(x, abs=0.02)
    assert (ink * (rows + 0.5)).sum() / ink.sum() / dots == pytest.approx(y, abs=0.02)


@pytest.mark.parametrize("limit", [50.0, 66.0, 116.0, 140.0, 210.0])
@pytest.mark.parametrize(("side", "border"), [(2.0, 0.0), (5.0, 1.0), (10.0, 3.0)])
@pytest.mark.parametrize("label", ["", "tray 12 of the second test, printed for the robot", "Ä" * 20])
def test_nothing_runs_off_the_page_or_into_another_thing(limit, side, border, label):
    (page, *_) = pages([marker_tile(Print("surf", side))] * 3, (limit, 80.0), border, label)
    image = 255 - raster(page, 150.0)
    inside = round((MARGIN_MM - 1) * 150 / 25.4)
    assert image[inside:-inside, inside:-inside].sum() == image.sum() > 0
    texts = [item for item in page.items if isinstance(item, Text)]
    marks = [item for item in page.items if isinstance(item, Box)]
    for text in texts:
        right = text.x_mm + text_length(text.text) * text.height_mm
        assert right <= limit - MARGIN_MM + 1e-6
        assert text.height_mm >= SMALLEST_TEXT_MM
        above = [mark for mark in marks if text.y_mm - text.height_mm / 2 < mark.y_mm + mark.height_mm]
        crossed = [m for m in above if text.y_mm > m.y_mm and text.x_mm < m.x_mm + m.width_mm and m.x_mm < right]
        assert crossed == []
    printed = " ".join(text.text for text in sorted(texts, key=lambda text: text.y_mm))
    assert f"{page.scale_bar_mm:g} mm between the ticks if printed at 100 %" in printed
    assert label in printed


def test_a_label_that_cannot_be_printed_is_refused():
    with pytest.raises(InputError, match=r"label: expected one that fits 34 mm of small print, got '.*WWW"):
        pages([marker_tile(Print("surf", 5.0))], (50.0, 80.0), label="W" * 80)


def test_where_there_is_room_the_small_print_has_its_height():
    (page,) = pages([marker_tile(Print("surf", 80.0))], A4, label="lab 3")
    small = [(item.height_mm, item.text) for item in page.items if isinstance(item, Text)]
    footer = "100 mm between the ticks if printed at 100 %   peakmark   lab 3"
    assert small == [(2.2, "surf-dark, side 80 mm"), (2.2, footer)]


@pytest.mark.parametrize("gap", [None, 5.0, 30.0])
@pytest.mark.parametrize("border", [0.0, 5.0, 20.0])
def test_arrays_hang_apart_on_the_sheet_already(gap, border):
    """From marker to marker one and a half steps, where one step is a neighbour in the array."""
    side = 15.0
    (page, *_) = pages([array_tile(code, side, gap) for code in range(6)], paper_size("a3"), border)
    step = side + (side / 2 if gap is None else gap)
    centers = np.array([(m.x_mm, m.y_mm) for m in page.markers]).reshape(6, 3, 2)
    gaps = np.linalg.norm(centers[:, None, :, None] - centers[None, :, None], axis=-1).min(axis=(2, 3))
    assert gaps[~np.eye(6, dtype=bool)].min() >= 1.5 * step - 1e-9


@pytest.mark.parametrize(("gap", "fits"), [(None, 70.0), (60.0, 57.5)])
def test_an_array_larger_than_the_page_is_told_the_largest_side(gap, fits):
    with pytest.raises(InputError, match=f"got .* mm: a side of {fits:g} mm fits"):
        pages([array_tile(5, 80.0, gap)], A4)
    assert pages([array_tile(5, fits, gap)], A4)
    with pytest.raises(InputError, match="expected at most"):
        pages([array_tile(5, fits + 0.1, gap)], A4)


@pytest.mark.parametrize("code", [0, 3, 5, 7])
def test_sheets_of_sift_arrays_decode_as_printed(code):
    (page,) = pages([array_tile(code, 60.0, pattern="sift")], A4)
    image = np.rint(20 + 0.8 * raster(page, 30.0) / 257).astype(np.uint8)  # 16 bits
    read = decode_arrays(identify(image, detector="sift"), image=image)
    assert [(array.code, array.doubt) for array in read] == [(code, "")]
