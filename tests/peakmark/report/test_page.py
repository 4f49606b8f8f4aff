"""The page: texts are shown as they are, numbers as people read them, and everything is inside the one file."""

import base64
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure
from PIL import Image

from peakmark.report import plots
from peakmark.report.page import (
    CaptionedImage,
    Section,
    Table,
    cell,
    jpeg_uri,
    markdown_table,
    svg_file_uri,
    svg_uri,
    write_report,
)

EVIL = '<script>alert("1")</script>'


def content(uri: str) -> bytes:
    """Return what a data URI holds."""
    return base64.b64decode(uri.partition("base64,")[2])


def some_figure() -> Figure:
    figure, ax = plots.new_figure()
    ax.plot([0, 1], [0, 1])
    return figure


def test_every_text_is_escaped_and_every_part_is_there(tmp_path: Path) -> None:
    table = Table((EVIL, "n"), [(EVIL, 1234)])
    image = CaptionedImage("data:image/jpeg;base64,AAAA", EVIL, 20, 10)
    section = Section(EVIL, EVIL, table, image.uri, EVIL, links=("a b.csv",), images=[image], data=table)
    write_report(tmp_path / "report.html", EVIL, EVIL, [section])
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "<script" not in page
    assert page.count("&lt;script&gt;") >= 10
    assert page.count('<td class="number">1,234</td>') == 2
    assert 'width="20" height="10"' in page
    assert 'href="a%20b.csv"' in page


@pytest.mark.parametrize(
    ("value", "text"), [(None, "–"), (0.123456, "0.1235"), (12345.6, "12,346"), (12345, "12,345"), ("as is", "as is")]
)
def test_cells_are_formatted_by_kind(value: str | float | None, text: str) -> None:
    assert cell(value) == text


def test_a_figure_is_the_same_bytes_each_time_and_as_in_its_file(tmp_path: Path) -> None:
    plots.save(some_figure(), tmp_path / "f.svg")
    assert (
        content(svg_uri(some_figure()))
        == (tmp_path / "f.svg").read_bytes()
        == content(svg_file_uri(tmp_path / "f.svg"))
    )
    for name in ("a.png", "b.png"):
        plots.save(some_figure(), tmp_path / name)
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()


@pytest.mark.parametrize(("width", "shown"), [(300, 200), (100, 100)])
def test_wide_images_are_scaled_down_and_others_kept(width: int, shown: int) -> None:
    image = np.full((width // 2, width, 3), (200, 30, 30), np.uint8)
    decoded = np.asarray(Image.open(BytesIO(content(jpeg_uri(image, 200)))))
    assert decoded.shape == (shown // 2, shown, 3)
    assert np.abs(decoded.reshape(-1, 3).mean(axis=0) - (200, 30, 30)).max() < 4


def test_a_table_in_markdown_has_cells_as_people_read_them() -> None:
    text = markdown_table(("name", "n"), [("a", 1234), ("b", None), ("c", 0.12345)])
    assert text.splitlines() == ["| name | n |", "| --- | --- |", "| a | 1,234 |", "| b | – |", "| c | 0.1235 |"]
