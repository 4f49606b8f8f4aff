"""The pages of the command line, one a command, from the same declarations that `--help` shows."""

import re
from collections.abc import Iterator
from typing import Any

from typer import Context

from peakmark.cli.app import COMMANDS, load_command

_HEAD = (
    "# Commands\n",
    "`peakmark COMMAND --help` says the same in a terminal. Bad input is one line on stderr and exit status 2;",
    "all commands have the same [exit statuses](../../how-to/use-your-own-detector.md#limits-failures-and-the-end).\n",
    "| command | what it does |",
    "|---|---|",
)


def command_pages() -> Iterator[tuple[str, str]]:
    """Yield each page's path in the site, and its text; the first page lists the commands."""
    rows = [f"| [`peakmark {name}`]({name}.md) | {words} |" for name, (_, words) in COMMANDS.items()]
    yield "reference/commands/index.md", "\n".join([*_HEAD, *rows, ""])
    for name in COMMANDS:
        parts = _described(load_command(name), f"peakmark {name}", "#")
        yield f"reference/commands/{name}.md", "\n\n".join(parts) + "\n"


def _described(command: Any, called: str, mark: str) -> list[str]:
    """Return the paragraphs of a command, and those of the commands in it."""
    context = Context(command, info_name=called)
    parts = [f"{mark} {called}", *_paragraphs(command.help or "")]
    inner = command.list_commands(context) if hasattr(command, "list_commands") else []
    if not inner:
        parts += [f"```text\n{called} {' '.join(command.collect_usage_pieces(context))}\n```"]
        parts += _tables(command, context)
    for name in inner:
        parts += _described(command.get_command(context, name), f"{called} {name}", f"{mark}#")
    return parts


def _paragraphs(help_text: str) -> list[str]:
    """Return the paragraphs of a command's help, and its examples as a block."""
    words, _, examples = help_text.partition("\b\n")
    parts = [_cell(part) for part in words.split("\n\n") if part.strip()]
    lines = [line.strip() for line in examples.splitlines()[1:] if line.strip()]
    return [*parts, "\n".join(["```text", *lines, "```"])] if lines else parts


def _tables(command: Any, context: Any) -> list[str]:
    """Return the table of the arguments, and that of the options, if there are any."""
    parts = []
    for kind in ("argument", "option"):
        records = [p.get_help_record(context) for p in command.params if p.param_type_name == kind and p.name != "help"]
        if rows := [_row(*record) for record in records if record]:
            parts.append("\n".join([f"| {kind} | meaning |", "|---|---|", *rows]))
    return parts


def _row(names: str, words: str) -> str:
    """Return a table's row of what `--help` says: names and type, then the meaning, which ends with the default."""
    called, _, takes = names.partition(" <")
    meaning = _cell(words)
    if end := re.search(r"\s*\[(default: .*?|required)\]\s*$", words):
        meaning = f"{_cell(words[: end.start()])} *{_cell(end[1])}*"
    return f"| `{called}` {_cell(takes.rstrip('>'))} | {meaning} |"


def _cell(words: str) -> str:
    """Return text that Markdown shows as it is, on one line."""
    return re.sub(r"([|<*_\[\]])", r"\\\1", re.sub(r"\s+", " ", words.strip()))
