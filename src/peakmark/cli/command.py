"""What every command shares: errors as one line, and exit statuses 0, 2 (bad input) and 3 (renderer)."""

import sys
from collections.abc import Callable
from io import TextIOWrapper
from typing import Any, NoReturn

import typer

from peakmark.errors import InputError, RendererError


def run_command(command: Callable[..., Any]) -> NoReturn:
    """Run a function of typed arguments, or a Typer app, as a program."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="replace")  # a terminal of another encoding shows ? for →
    try:
        if isinstance(command, typer.Typer):
            command()
        else:
            typer.run(command)
    except InputError as error:
        _stop(error, 2)
    except RendererError as error:
        _stop(error, 3)
    sys.exit(0)


def print_error(reason: object) -> None:
    """Print what is wrong as one line on standard error."""
    print("error:", one_line(reason), file=sys.stderr)


def one_line(text: object) -> str:
    """Return text from outside (file names, messages) as one line; characters that steer a terminal are escaped."""
    line = " ".join(str(text).split())
    return "".join(letter if letter.isprintable() else ascii(letter)[1:-1] for letter in line)


def _stop(reason: object, status: int) -> NoReturn:
    print_error(reason)
    sys.exit(status)
