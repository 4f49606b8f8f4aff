"""Trajectories in space: what the page holds, and that it needs no network."""

import re
from pathlib import Path

import numpy as np
import pytest

from peakmark.report.trajectory_view import Line, write_trajectory_view

pytest.importorskip("plotly")


def test_the_page_holds_lines_links_and_its_own_script(tmp_path: Path) -> None:
    positions = np.array([[0.0, 0, 1], [0.5, 0, 1], [np.nan] * 3, [1.5, 0.1, 1]])
    lines = [Line("truth", np.nan_to_num(positions), ["a", "b", "c", "d"]), Line("<found>", positions, ["e"] * 4)]
    links = [f"frames/{k}.jpg" for k in range(4)]
    path = tmp_path / "trajectory.html"
    write_trajectory_view(path, "Title & more", "Lead.", lines, np.zeros((2, 3)), links)
    page = path.read_text(encoding="utf-8")
    assert "Title &amp; more" in page
    assert "frames/3.jpg" in page.replace("\\u002f", "/")
    assert not re.search(r"<(script|link|img)[^>]+(src|href)=.https?:", page)
    assert "NaN" not in page.split("Plotly.newPlot")[-1]
    assert 4e6 < len(page) < 8e6
