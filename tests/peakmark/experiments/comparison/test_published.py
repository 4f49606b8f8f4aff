"""What the documentation says of the comparison is what its data say, and the winners are the rule's."""

import json

from peakmark.experiments.comparison.figures import ComparisonFigures, best_of
from peakmark.experiments.comparison.results import markdown, readme_table
from peakmark.plain import from_plain
from tests.places import ROOT

FOLDER = ROOT / "docs" / "figures" / "comparison"
FIGURES = from_plain(ComparisonFigures, json.loads((FOLDER / "data.json").read_text("utf-8")))


def test_the_page_is_made_of_the_data() -> None:
    assert (FOLDER / "index.md").read_text("utf-8") == markdown(FIGURES)


def test_the_readme_has_the_data_s_table() -> None:
    assert readme_table(FIGURES) in (ROOT / "README.md").read_text("utf-8")


def test_who_wins_is_what_the_rule_says() -> None:
    for topic in FIGURES.topics:
        assert topic.best == best_of(topic.readers, topic.larger_is_better)
