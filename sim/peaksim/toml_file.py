"""TOML files as models: read with a size limit; a fault is one line with file, field and what was expected."""

import tomllib
from collections.abc import Iterable
from difflib import get_close_matches
from pathlib import Path
from typing import Any, TypeVar, get_args

from pydantic import BaseModel, ValidationError

from peaksim.errors import SceneError
from peaksim.text_file import read_text

Model = TypeVar("Model", bound=BaseModel)

_LARGEST_FILE = 1_000_000  # bytes
_MOST_FAULTS = 10  # in a message


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
        One line with `name` (the file), each faulty field, what was expected there and what came.
    """
    try:
        return model.model_validate(content)
    except ValidationError as error:
        raise SceneError(f"{name}: {_faults(model, error)}") from error


def suggestion(word: str, known: Iterable[str]) -> str:
    """Return " (did you mean 'x'?)" for the known word that is closest to a mistyped one; empty if none is close."""
    close = get_close_matches(word, list(known), n=1)
    return f" (did you mean {close[0]!r}?)" if close else ""


def _faults(model: type[BaseModel], error: ValidationError) -> str:
    """Return one line: what is wrong with each faulty field."""
    # an unknown field explains a missing one beside it, so it comes first
    faults = sorted(error.errors(include_url=False), key=lambda fault: fault["type"] != "extra_forbidden")
    lines = [f"{_field(fault['loc'])}: {_what(model, fault)}" for fault in faults[:_MOST_FAULTS]]
    more = [f"and {len(faults) - _MOST_FAULTS} more"] if len(faults) > _MOST_FAULTS else []
    return "; ".join(lines + more)


def _field(location: tuple[Any, ...]) -> str:
    return "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in location).lstrip(".") or "file"


def _what(model: type[BaseModel], fault: Any) -> str:
    if fault["type"] == "extra_forbidden":
        fields = {field for table in _tables_at(model, fault["loc"][:-1]) for field in table.model_fields}
        return f"unknown field{suggestion(str(fault['loc'][-1]), sorted(fields))}"
    if fault["type"] == "missing":
        return "missing field"
    message = str(fault["msg"])
    if fault["type"] == "value_error":  # our own messages already say what came
        return message.removeprefix("Value error, ")
    return f"{message[0].lower()}{message[1:]}, got {fault['input']!r:.80}"


def _tables_at(model: type[BaseModel], location: tuple[Any, ...]) -> list[type[BaseModel]]:
    """Return the tables that may stand at a location; where they are of several kinds, that of the stated kind."""
    tables = [model]
    for part in location:
        if not isinstance(part, str):
            continue
        inner = [
            kind for table in tables if part in table.model_fields for kind in _tables_in(_annotation(table, part))
        ]
        of_kind = [table for table in tables if "kind" in table.model_fields and part in _kinds(table)]
        tables = inner or of_kind or tables
    return tables


def _annotation(table: type[BaseModel], field: str) -> Any:
    return table.model_fields[field].annotation


def _kinds(table: type[BaseModel]) -> tuple[Any, ...]:
    return get_args(_annotation(table, "kind"))


def _tables_in(annotation: Any) -> list[type[BaseModel]]:
    """Return the table classes inside `tuple[X, ...]`, `dict[str, X]` or `X | Y | None`."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [table for argument in get_args(annotation) for table in _tables_in(argument)]
