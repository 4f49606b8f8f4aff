"""What the terminal shows: bars that count, tables that line up, and nothing where it shall be quiet."""

from io import StringIO
from pathlib import Path

import pytest
from rich.console import Console

from peakmark.cli.options import given
from peakmark.cli.terminal import FIGURES, print_path, print_table, progress_bar


@pytest.mark.parametrize("quiet", [False, True])
def test_a_bar_counts_steps_and_leaves_nothing_behind(quiet: bool) -> None:
    text = StringIO()
    with progress_bar(Console(file=text, quiet=quiet), "work", 9) as bar:
        bar.advance()
        bar.advance(3)
        assert bar.done == 4
        bar.show(8, 10)
        assert bar.done == 8
    assert text.getvalue().strip() == ""


def test_a_table_has_figures_on_the_right_and_a_dash_for_none() -> None:
    text = StringIO()
    print_table(Console(file=text, width=60), "floor", FIGURES, [("features", 48373), ("recall", None)])
    lines = text.getvalue().splitlines()
    assert any("features │ 48,373 " in line for line in lines)
    assert any("recall   │      – " in line for line in lines)


def test_a_path_is_one_line_as_it_is() -> None:
    text = StringIO()
    path = Path("out") / ("[bold]" + "long" * 40) / "report.html"
    print_path(Console(file=text, width=40), path)
    assert text.getvalue() == f"Results: {path}\n"


def test_only_what_was_stated_is_given() -> None:
    assert given(threshold=0.0, octaves=None, upright=False, extended=True) == {"threshold": 0.0, "extended": True}
