"""TOML files as models: read with a size limit; a fault is one line with file, field and what was expected."""

import tomllib
from difflib import get_close_matches
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from peaksim.errors import SceneError
from peaksim.text_file import read_text

Model = TypeVar("Model", bound=BaseModel)

_LARGEST_FILE = 1_000_000  # bytes


def parse_toml(file: Path) -> dict[str, Any]:
    """Read a TOML file.

    Raises
    ------
    SceneError
        One line: it is missing, too large, or not TOML.
    """
    try:
        return tomllib.loads(read_text(file, _LARGEST_FILE, SceneError))
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        raise SceneError(f"{file}: is not TOML: {error}") from error


def validate(model: type[Model], content: Any, name: str) -> Model:
    """Return a table's content as a model.

    Raises
    ------
    SceneError
        One line with `name` (the file), the first faulty field, what was expected and what came.
    """
    try:
        return model.model_validate(content)
    except ValidationError as error:
        raise SceneError(f"{name}: {_first_fault(model, error)}") from error


def _first_fault(model: type[BaseModel], error: ValidationError) -> str:
    """Return one line: what is wrong with the first faulty field, and how many more there are."""
    faults = error.errors(include_url=False)
    # an unknown field explains a missing one beside it, so it comes first
    fault = min(faults, key=lambda f: f["type"] != "extra_forbidden")
    where = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in fault["loc"]).lstrip(".")
    more = f" (and {len(faults) - 1} more)" if len(faults) > 1 else ""
    return f"{where or 'file'}: {_what(model, fault)}{more}"


def _what(model: type[BaseModel], fault: Any) -> str:
    if fault["type"] == "extra_forbidden":
        return f"unknown field{_suggestion(model, fault['loc'])}"
    if fault["type"] == "missing":
        return "missing field"
    message = str(fault["msg"])
    if fault["type"] == "value_error":  # our own messages already say what came
        return message.removeprefix("Value error, ")
    return f"{message[0].lower()}{message[1:]}, got {fault['input']!r:.80}"


def _suggestion(model: Any, location: tuple[Any, ...]) -> str:
    """Name the closest known field of the same table."""
    for part in location[:-1]:
        if isinstance(part, str):
            fields = getattr(model, "model_fields", {})
            model = _table_type(fields[part].annotation) if part in fields else model
    close = get_close_matches(str(location[-1]), list(getattr(model, "model_fields", {})), n=1)
    return f" (did you mean {close[0]!r}?)" if close else ""


def _table_type(annotation: Any) -> Any:
    """Return the table class inside `tuple[X, ...]`, `dict[str, X]` or `X | None`."""
    for argument in getattr(annotation, "__args__", ()):
        if hasattr(argument, "model_fields"):
            return argument
        inner = _table_type(argument)
        if inner is not None:
            return inner
    return annotation if hasattr(annotation, "model_fields") else None
