"""Results of a run: a line of CSV for each row, and the detectors that failed."""

import csv

from peakmark.experiments.detectability.points import DetectabilityConfig
from peakmark.experiments.detectability.results import as_csv, fault_rows, lead
from tests.peakmark.experiments.detectability.rows import curve, row


def test_csv_has_a_line_a_row_and_nothing_for_none():
    rows = curve("noise", "m", "d", {0: 100, 50: 0})
    first, second = csv.DictReader(as_csv(rows).splitlines())
    assert float(first["response"]) == 10
    assert second["response"] == ""


def test_only_faulty_rows_are_listed():
    rows = [row("noise", "m", "d", 0), row("noise", "m", "d", 1, failures=3, first_failure="E: x", outside=2)]
    assert [list(line) for line in fault_rows(rows).rows] == [["d", "noise", 1, 3, 0, 2, "E: x"]]


def test_the_report_says_how_many_images_a_point_it_took():
    assert lead(DetectabilityConfig(trials=8)).startswith("8 random phases")
    assert lead(DetectabilityConfig(trials=8, is_paper=True)).startswith("One centred image a point")
