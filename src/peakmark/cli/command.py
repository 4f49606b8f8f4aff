"""What every command shares: errors as one line, and exit statuses 0, 2 (bad input) and 3 (renderer)."""

import sys
from collections.abc import Callable
from typing import Any, NoReturn

import typer

from peakmark.errors import InputError, RendererError


def run_command(command: Callable[..., Any]) -> NoReturn:
    """Run a function of typed arguments, or a Typer app, as a program."""
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


def _stop(reason: object, status: int) -> NoReturn:
    print("error:", " ".join(str(reason).split()), file=sys.stderr)
    sys.exit(status)
