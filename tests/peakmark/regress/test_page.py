"""report.html of a comparison: what got worse with its frames side by side, figures with data, nothing that runs."""

import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from peakmark.regress.compare import Comparison, compare_records
from peakmark.regress.page import draw_result, summary, write_page
from peakmark.regress.run import IMAGE_NAME
from peakmark.report.overlay import FALSE, FOUND, MISSED
from tests.peakmark.regress.helpers import frame, marker, missed, record, sound

EVIL = '"><script>alert(1)</script>'


class Tags(HTMLParser):
    """All tags of a page with their attributes."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.found: list[tuple[str, dict[str, str | None]]] = []
        self.feed(page)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.found.append((tag, dict(attrs)))


@pytest.fixture
def worse() -> Comparison:
    after = record(*(frame(i, missed(), marker(90.0, side=60.0)) for i in range(20)))
    evil = replace(after.detector, name=EVIL)
    return compare_records(replace(after, suite=EVIL, detector=evil), replace(sound(), suite=EVIL))


@pytest.fixture
def page(worse: Comparison, tmp_path: Path) -> str:
    for i in range(20):
        Image.fromarray(np.full((48, 120), 90, np.uint8)).save(tmp_path / IMAGE_NAME.format(i))
    write_page(tmp_path / "report.html", worse, tmp_path)
    return (tmp_path / "report.html").read_text(encoding="utf-8")


def test_the_page_needs_nothing_else_and_runs_nothing(page: str) -> None:
    tags = Tags(page).found
    assert "script" not in {tag for tag, _ in tags}
    assert not [name for _, attrs in tags for name in attrs if name.startswith("on")]
    sources = [attrs.get("src") or attrs.get("href") or "" for tag, attrs in tags if tag in ("img", "link", "a")]
    assert all(source.startswith(("data:", "#")) for source in sources)


def test_a_fault_is_shown_before_and_after_side_by_side(page: str, worse: Comparison) -> None:
    captions = re.findall(r"<figcaption>(Frame .*?)</figcaption>", page)
    shown = [frame for change in worse.faults for frame in change.frames]
    assert len(captions) == 2 * len(shown) > 0
    assert "before: 2 of 2 markers found" in captions[0]
    assert "after: 1 of 2 markers found" in captions[1]


def test_links_lead_to_the_faults(page: str) -> None:
    tags = Tags(page).found
    ids = {attrs["id"] for _, attrs in tags if "id" in attrs}
    targets = {(attrs["href"] or "").removeprefix("#") for tag, attrs in tags if tag == "a"}
    assert targets
    assert targets <= ids


def test_figures_have_their_data(page: str) -> None:
    assert page.count("<summary>Data</summary>") == page.count("image/svg+xml") == 2


def test_without_images_and_faults_there_is_still_a_page(tmp_path: Path) -> None:
    write_page(tmp_path / "report.html", compare_records(sound(), sound()), tmp_path / "nowhere")
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "No regression." in page
    assert "figcaption>Frame" not in page


def test_found_missed_and_false_are_drawn_where_they_are() -> None:
    lost = replace(missed(8.0), true_xy=(80.0, 20.0))
    result = frame(0, marker(30.0, error=0.0, side=8.0), lost, false_xy=((110.0, 30.0),))
    drawn = draw_result(np.full((48, 120), 90, np.uint8), result).astype(int)
    for (x, y), colour in (((30, 26), FOUND), ((80, 20), MISSED), ((110, 20), FALSE)):
        assert np.abs(drawn[y - 1 : y + 2, x - 1 : x + 2] - colour).sum(axis=2).min() < 60


def test_a_frame_in_words() -> None:
    result = frame(0, marker(), missed(), false_xy=((1.0, 1.0),))
    assert summary(result) == "1 of 2 markers found, 1 false, 500 features"
    assert summary(frame(0, failure="timeout")) == "no answer (timeout)"


@pytest.mark.parametrize("far", [3e38, -3e38, 1e10])
def test_what_lies_far_outside_is_not_drawn(far: float) -> None:
    image = np.zeros((60, 80), np.uint8)
    for result in (
        frame(0, false_xy=((far, far),)),
        frame(0, replace(missed(), true_xy=(far, 5.0), side_px=far)),
        frame(0, replace(marker(), xy=(far, far))),
    ):
        assert not draw_result(image, result).any()
