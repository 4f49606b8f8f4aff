"""Links of the documentation lead to files and headings that are there."""

import re
import unicodedata
from pathlib import Path

import pytest

from tests.documents import PAGES
from tests.places import ROOT

_LINK = re.compile(r"\]\(([^)\s]+?)(?:#([^)\s]*))?\)")


def anchors(path: Path) -> set[str]:
    """Return the anchors of a page's headings, as Python-Markdown and GitHub make them of plain words."""
    text = re.sub(r"^```.*?^```$", "", path.read_text(encoding="utf-8"), flags=re.DOTALL | re.MULTILINE)
    headings = re.findall(r"^#+ (.+)$", text, flags=re.MULTILINE)
    plain = [re.sub(r"[^\w\s-]", "", unicodedata.normalize("NFKD", heading)).strip().lower() for heading in headings]
    return {re.sub(r"[-\s]+", "-", heading) for heading in plain}


def links(page: str) -> list[tuple[str, str]]:
    """Return (path, anchor) of a page's links within the repository."""
    text = (ROOT / page).read_text(encoding="utf-8")
    text = re.sub(r"^```.*?^```$|`[^`\n]+`", "", text, flags=re.DOTALL | re.MULTILINE)
    found = [(path, anchor) for path, anchor in _LINK.findall(text) if "://" not in path]
    return found + [("", anchor) for anchor in re.findall(r"\]\(#([^)\s]+)\)", text)]


@pytest.mark.parametrize("page", PAGES)
def test_links_lead_to_files_and_headings(page: str) -> None:
    for path, anchor in links(page):
        target = (ROOT / page).parent / path if path and not path.startswith("#") else ROOT / page
        if (
            "reference/api/" in path
            or "reference/commands/" in path
            or path.startswith(("api/", "commands/", "gallery/"))
        ):
            continue  # pages that `make docs` makes, and whose links it checks
        assert target.exists(), f"{page}: {path}"
        if anchor:
            assert anchor in anchors(target), f"{page}: {path}#{anchor}"


@pytest.mark.parametrize("page", PAGES)
def test_images_say_what_they_show(page: str) -> None:
    text = (ROOT / page).read_text(encoding="utf-8")
    assert "![](" not in text
