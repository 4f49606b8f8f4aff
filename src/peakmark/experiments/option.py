"""Checks of what users ask of an experiment; the message names the option, what was expected and what came."""

import math
from collections.abc import Sequence

from peakmark.errors import InputError


def check_range(name: str, value: float | None, low: float, high: float = math.inf, unit: str = "") -> None:
    """Raise an `InputError` unless an option lies between two numbers, both allowed; None is not checked."""
    if value is not None and not low <= value <= high:
        expected = f"{low:.12g} or more" if high == math.inf else f"{low:.12g}…{high:.12g}{unit}"
        raise InputError(f"--{name}: expected {expected}, got {value}")


def check_choice(name: str, value: str, choices: Sequence[str]) -> None:
    """Raise an `InputError` unless an option is one of some words."""
    if value not in choices:
        raise InputError(f"--{name}: expected {', '.join(choices[:-1])} or {choices[-1]}, got {value}")
