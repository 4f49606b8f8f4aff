"""The site: built without a warning, read in a browser as wide as a phone and a desk, without a network."""

import shutil
import subprocess
import sys
from collections.abc import Iterator
from ctypes.util import find_library
from pathlib import Path
from typing import Any

import pytest

from tests.peaksim.corpus.helpers import child_environment
from tests.places import ROOT

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        CHROMIUM is None or find_library("atomic") is None,
        reason="no chromium, or no libatomic for Playwright; tools/install.sh installs them where it may",
    ),
]
playwright = pytest.importorskip("playwright.sync_api")
pytest.importorskip("mkdocstrings")
pytest.importorskip("material")

QUESTIONS = {
    "how far can I see an 8 cm marker": ("Choose a size", "8.35 m"),
    "does it beat AprilTag in shadow": ("Beside other markers", "AprilTag"),
    "how do I run it in my CI": ("Keep a detector from getting worse", "peakmark regress compare"),
    "what are the axes": ("Conventions", "right-handed"),
}
"""What a reader asks → the link of the first page that leads there, and what stands there."""


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", folder]
    environment = {**child_environment(), "NO_MKDOCS_2_WARNING": "1"}
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stderr
    assert "WARNING" not in done.stderr
    return folder


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with playwright.sync_playwright() as tools:
        chromium = tools.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        yield chromium
        chromium.close()


@pytest.mark.parametrize("width", [390, 1280])
def test_pages_fit_and_ask_nobody(site: Path, browser: Any, width: int) -> None:
    page = browser.new_page(viewport={"width": width, "height": 800})
    complaints: list[str] = []
    requests: list[str] = []
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.on("request", lambda request: requests.append(request.url))
    for path in sorted(site.rglob("*.html")):
        page.goto(path.as_uri())
        page.wait_for_load_state("load")
        across, window = page.evaluate("[document.documentElement.scrollWidth, window.innerWidth]")
        assert across <= window, path
        broken = page.evaluate("Array.from(document.images, i => i.complete && i.naturalWidth ? '' : i.src).join('')")
        assert broken == "", path
    assert complaints == []
    assert [url for url in requests if not url.startswith(("file:", "data:", "blob:"))] == []
    page.close()


@pytest.mark.parametrize("question", QUESTIONS)
def test_a_question_is_answered_one_click_from_the_first_page(site: Path, browser: Any, question: str) -> None:
    link, words = QUESTIONS[question]
    page = browser.new_page(viewport={"width": 390, "height": 800})
    page.goto((site / "index.html").as_uri())
    page.click(f"article a:text-is('{link}')")
    page.wait_for_load_state("load")
    assert words in page.inner_text("article")
    page.close()


def test_the_search_answers_in_a_page_from_a_folder(site: Path, browser: Any) -> None:
    page = browser.new_page(viewport={"width": 1280, "height": 800})
    page.goto((site / "index.html").as_uri())
    page.click("input[name=query]")
    page.keyboard.type("rolling shutter")
    page.wait_for_selector(".md-search-result__link", timeout=20_000)
    assert "utter" in page.inner_text(".md-search-result__list")
    page.close()
