"""What the terminal shows: a bar while a command works, tables of figures, and where the results are."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TaskID, TextColumn, TimeRemainingColumn
from rich.table import Table

from peakmark.errors import one_line
from peakmark.report.page import cell

FIGURES = ("figure", "value")
"""Head of a table of figures."""

FIGURES_WITH_INTERVALS = (*FIGURES, "low", "high", "of")
"""Head of a table of figures with their intervals and the size of the sample."""


def new_console(quiet: bool = False) -> Console:
    """Return what prints on the terminal: text as it is, neither [brackets] nor :colons: are markup."""
    return Console(quiet=quiet, markup=False, emoji=False)


@dataclass(frozen=True)
class Bar:
    """A progress bar on the terminal."""

    progress: Progress
    """Draws it."""
    task: TaskID
    """Its line there."""

    @property
    def done(self) -> int:
        """Steps so far."""
        return int(self.progress.tasks[self.task].completed)

    def advance(self, count: int = 1) -> None:
        """Move the bar by so many steps."""
        self.progress.advance(self.task, count)

    def show(self, done: int, of: int) -> None:
        """Move the bar to so many of so many steps."""
        self.progress.update(self.task, completed=done, total=of)


@contextmanager
def progress_bar(console: Console, title: str, total: int | None = None) -> Iterator[Bar]:
    """Show a bar while the block runs; a total that is not known yet is None."""
    columns = (TextColumn("{task.description}", markup=False), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    is_hidden = console.quiet or not console.is_terminal
    with Progress(*columns, console=console, transient=True, disable=is_hidden) as progress:
        yield Bar(progress, progress.add_task(title, total=total))


def print_table(console: Console, title: str, head: Sequence[str], rows: Sequence[Sequence[Any]]) -> None:
    """Print a table whose first column is text and whose others are figures."""
    table = Table(*head, title=title)
    for column in table.columns[1:]:
        column.justify = "right"
    for name, *values in rows:
        table.add_row(name, *map(cell, values))
    console.print(table)


def print_path(console: Console, path: Path | str, title: str = "Results") -> None:
    """Print where something was written, on one line however long it is."""
    console.print(f"{title}: {one_line(str(path))}", soft_wrap=True, markup=False)
