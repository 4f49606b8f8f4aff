"""What the terminal shows: bars that count, tables that line up, and nothing where it shall be quiet."""

import re
from io import StringIO
from pathlib import Path

import pytest
from rich.console import Console

from peakmark.cli.options import given
from peakmark.cli.terminal import FIGURES, new_console, print_path, print_table, progress_bar
from tests.places import ROOT


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


def test_brackets_and_colons_are_text_everywhere(capsys: pytest.CaptureFixture[str]) -> None:
    console = new_console()
    console.print("pip install 'peakmark[evo]' :smile:")
    print_table(console, "[bold]floor[/] :x:", ("[red]a", "b"), [("my[scene]", "[/]")])
    shown = capsys.readouterr().out
    for text in ("peakmark[evo]' :smile:", "[bold]floor[/] :x:", "[red]a", "my[scene]", "[/]"):
        assert text in shown
    print_table(new_console(quiet=True), "a", FIGURES, [("b", 1)])
    assert capsys.readouterr().out == ""


def test_every_command_prints_through_the_one_console() -> None:
    for path in (ROOT / "src" / "peakmark" / "cli").glob("*.py"):
        made = re.findall(r"(?<!new_)\b[Cc]onsole\(|[Tt]yper\(", path.read_text(encoding="utf-8"))
        assert len(made) == {"terminal.py": 1, "command.py": 1}.get(path.name, 0), path
