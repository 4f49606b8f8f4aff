"""Our own sheets, as they leave the printer: every array reads as it was printed."""

import pytest

from peakmark import decode_arrays, identify
from peakmark.markers.sheet import PAPERS_MM, array_tile, largest_side_mm, pages, paper_size
from peakmark.markers.sheet_files import raster

MARKER_PX = 26.0


def codes_of_sheets(side_mm: float, paper: str, landscape: bool) -> list[int | None]:
    """Return the codes read from the pages that hold all eight arrays, a marker `MARKER_PX` wide."""
    laid_out = pages([array_tile(code, side_mm) for code in range(8)], paper_size(paper, landscape))
    images = [raster(page, max(MARKER_PX / side_mm * 25.4, 25.0)) for page in laid_out]
    return [array.code for image in images for array in decode_arrays(identify(image), image=image)]


@pytest.mark.parametrize(
    ("side_mm", "paper", "landscape"),
    [
        (12, "a4", False),
        (20, "a4", True),
        (25, "a4", False),
        (25, "a5", False),
        (30, "letter", True),
        (60, "a4", False),
    ],
)
def test_every_array_of_a_sheet_reads_as_printed(side_mm: float, paper: str, landscape: bool) -> None:
    assert codes_of_sheets(side_mm, paper, landscape) == list(range(8))


@pytest.mark.slow
@pytest.mark.parametrize("paper", PAPERS_MM)
@pytest.mark.parametrize("landscape", [False, True])
def test_every_array_reads_as_printed_at_every_size_that_fits(paper: str, landscape: bool) -> None:
    largest = largest_side_mm(array_tile(0, 80.0), paper_size(paper, landscape))
    for side_mm in [*range(8, int(largest), 7), largest]:
        assert codes_of_sheets(side_mm, paper, landscape) == list(range(8)), side_mm
