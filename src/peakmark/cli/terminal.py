"""What the commands print: tables of figures."""

from collections.abc import Sequence
from typing import Any

from rich.console import Console
from rich.table import Table

from peakmark.report.page import cell


def print_table(console: Console, title: str, head: Sequence[str], rows: Sequence[Sequence[Any]]) -> None:
    """Print a table whose first column is text and whose others are figures."""
    table = Table(*head, title=title)
    for column in table.columns[1:]:
        column.justify = "right"
    for name, *values in rows:
        table.add_row(name, *map(cell, values))
    console.print(table)
