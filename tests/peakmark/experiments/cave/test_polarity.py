"""Polarity told both ways: what the comparison asks, and that it is hard enough to tell them apart."""

import json
from dataclasses import replace
from pathlib import Path
from typing import get_args

import pytest

from peakmark.experiments.cave import polarity
from peakmark.experiments.cave.polarity import CONDITIONS, PolarityRow, told_polarities, totals, write_polarity
from peakmark.experiments.detectability.conditions import Condition
from peakmark.markers.patterns import Polarity
from peakmark.score.statistics import rate

USUAL = CONDITIONS["side (px)"][0]


def wrong(condition: Condition, images: int = 6) -> tuple[int, int, int]:
    told = [told_polarities(condition, p, 1, k) for p in get_args(Polarity) for k in range(images)]
    found = [one for one in told if one is not None]
    return len(found), sum(not laplacian for laplacian, _ in found), sum(not signature for _, signature in found)


def test_a_marker_seen_squarely_is_told_both_ways() -> None:
    assert wrong(USUAL) == (12, 0, 0)


def test_the_laplacian_outlasts_the_signature_on_faded_print() -> None:
    found, by_laplacian, by_signature = wrong(replace(USUAL, contrast=0.1, noise=10.0))
    assert found >= 5
    assert by_laplacian == 0
    assert by_signature >= found / 2


def test_a_marker_that_is_not_found_is_not_counted() -> None:
    assert told_polarities(replace(USUAL, side_px=6.0), "dark", 0, 0) is None


def test_rows_add_up_and_are_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    few = {name: conditions[:1] for name, conditions in CONDITIONS.items()}
    monkeypatch.setattr(polarity, "CONDITIONS", few)
    steps: list[int] = []
    rows = polarity.compare_polarity(1, 0, lambda: steps.append(1))
    assert len(rows) == len(steps) == len(few)
    assert all(row.images == 2 and row.found <= 2 for row in rows)
    found, by_laplacian, by_signature = totals(rows)
    rows.append(PolarityRow("noise σ", 1.0, 4, 3, rate(1, 3), rate(2, 3)))
    assert totals(rows) == (found + 3, by_laplacian + 1, by_signature + 2)
    write_polarity(rows, 1, 0, tmp_path)
    assert json.loads((tmp_path / "result.json").read_text())["rows"][-1]["wrong_by_signature"]["of"] == 3
    told = f"told {by_laplacian + 1} wrongly and the signature {by_signature + 2}"
    assert told in (tmp_path / "report.html").read_text()
