"""The report of a regression in a real browser: Debian's chromium, headless, as wide as a phone and a desk, printed."""

import shutil
from collections.abc import Iterator
from ctypes.util import find_library
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from peakmark.regress.compare import compare_records
from peakmark.regress.page import write_page
from peakmark.regress.run import IMAGE_NAME
from tests.peakmark.regress.helpers import frame, marker, missed, record, sound

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")

pytestmark = pytest.mark.skipif(
    CHROMIUM is None or find_library("atomic") is None,
    reason="no chromium, or no libatomic for Playwright; tools/install.sh installs them where it may",
)
playwright = pytest.importorskip("playwright.sync_api")

LONG_NAME = "exec:" + "a_program_with_a_long_name" * 6 + " <b>'\""


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A report with faults, images, and a detector's name that is long and looks like HTML."""
    folder = tmp_path_factory.mktemp("a folder's name")
    for i in range(20):
        levels = np.random.default_rng(i).integers(0, 255, (480, 640)).astype(np.uint8)
        Image.fromarray(levels).save(folder / IMAGE_NAME.format(i))
    after = record(*(frame(i, missed(), marker(90.0, side=60.0), features=300) for i in range(20)))
    named = replace(after, detector=replace(after.detector, name=LONG_NAME))
    write_page(folder / "report.html", compare_records(named, sound()), folder)
    return folder / "report.html"


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with playwright.sync_playwright() as tools:
        chromium = tools.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        yield chromium
        chromium.close()


class Seen:
    """A page, and everything that its console and network said."""

    def __init__(self, browser: Any, report: Path, width: int) -> None:
        self.page = browser.new_page(viewport={"width": width, "height": 800})
        self.complaints: list[str] = []
        self.requests: list[str] = []
        self.page.on("console", lambda message: self.complaints.append(message.text))
        self.page.on("pageerror", lambda error: self.complaints.append(str(error)))
        self.page.on("request", lambda request: self.requests.append(request.url))
        self.page.goto(report.as_uri())
        self.page.wait_for_load_state("load")


@pytest.fixture(params=[360, 1280])
def seen(browser: Any, report: Path, request: pytest.FixtureRequest) -> Iterator[Seen]:
    seen = Seen(browser, report, request.param)
    yield seen
    seen.page.close()


def test_it_loads_from_one_file_without_a_complaint(seen: Seen, report: Path) -> None:
    assert seen.complaints == []
    assert [url for url in seen.requests if not url.startswith("data:")] == [report.as_uri()]


def test_every_image_has_a_size(seen: Seen) -> None:
    sizes = seen.page.evaluate(
        "Array.from(document.images, i => [i.complete, i.naturalWidth, i.naturalHeight, i.clientWidth, i.clientHeight])"
    )
    assert len(sizes) >= 8
    assert all(complete and min(size) > 20 for complete, *size in sizes)


def test_nothing_scrolls_sideways_but_tables(seen: Seen) -> None:
    width, window = seen.page.evaluate("[document.documentElement.scrollWidth, window.innerWidth]")
    assert width <= window


def test_links_lead_where_they_say(seen: Seen) -> None:
    links = seen.page.query_selector_all("a")
    assert len(links) >= 4
    for link in links:
        link.click()
        title, top = seen.page.evaluate(
            "(() => { const s = document.querySelector(location.hash);"
            "         return [s.querySelector('h2').innerText, s.getBoundingClientRect().top] })()"
        )
        assert title == link.inner_text()
        assert top < 800


def test_before_and_after_stand_side_by_side_where_there_is_room(seen: Seen) -> None:
    first, second = (figure.bounding_box() for figure in seen.page.query_selector_all(".pair figure")[:2])
    is_wide = seen.page.viewport_size["width"] > 800
    assert (first["y"] == second["y"]) == is_wide
    assert (first["x"] == second["x"]) == (not is_wide)


def test_data_unfold(seen: Seen) -> None:
    details = seen.page.query_selector("details")
    assert details.query_selector("table").is_visible() is False
    details.query_selector("summary").click()
    assert details.query_selector("table").is_visible()


def test_it_prints(browser: Any, report: Path) -> None:
    page = browser.new_page()
    page.goto(report.as_uri())
    assert page.pdf(format="A4").startswith(b"%PDF")
    page.close()
