"""Typed records as plain values for JSON, and back."""

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from functools import cache
from types import NoneType
from typing import Any, TypeVar, get_args, get_origin, get_type_hints

import numpy as np

Record = TypeVar("Record")

INLINED = {"is_inlined": True}
"""Metadata of a dataclass's field that is a record: its plain values stand among the others, not under its name."""


def to_plain(value: Any) -> Any:
    """Return dictionaries, lists, numbers, texts and None for dataclasses, arrays and what is made of them.

    A class that has a method `to_plain` says itself what its plain values are.
    """
    if hasattr(value, "to_plain"):
        return to_plain(value.to_plain())
    if is_dataclass(value):
        return plain_fields(value)
    if isinstance(value, Mapping):
        return {name: to_plain(part) for name, part in value.items()}
    if isinstance(value, list | tuple):
        return [to_plain(part) for part in value]
    return value.tolist() if isinstance(value, np.ndarray | np.generic) else value


def plain_fields(record: Any) -> dict[str, Any]:
    """Return the plain values of a dataclass's fields, even if it has a `to_plain`."""
    plain: dict[str, Any] = {}
    for field in fields(record):
        part = to_plain(getattr(record, field.name))
        plain.update(part if field.metadata == INLINED else {field.name: part})
    return plain


def from_plain(kind: type[Record], plain: Any) -> Record:
    """Return a dataclass from its plain values, also after JSON; its fields' annotations say what they were.

    Dataclasses, arrays, tuples, and each of them or None, are restored; other values are taken as they are.
    """
    restored: Record = _restored(kind, plain)
    return restored


def _restored(hint: Any, plain: Any) -> Any:
    if isinstance(hint, type) and is_dataclass(hint):
        values = {field.name: plain if field.metadata == INLINED else plain[field.name] for field in fields(hint)}
        return hint(**{name: _restored(_hints(hint)[name], value) for name, value in values.items()})
    origin, parts = get_origin(hint), get_args(hint)
    if NoneType in parts:
        return None if plain is None else _restored(next(part for part in parts if part is not NoneType), plain)
    if origin is np.ndarray:
        return np.array(plain, dtype=get_args(parts[1])[0])
    if origin is tuple:
        kinds = parts[:1] * len(plain) if parts[-1] is Ellipsis else parts
        return tuple(_restored(part, value) for part, value in zip(kinds, plain, strict=True))
    return plain


@cache
def _hints(kind: Any) -> dict[str, Any]:
    return get_type_hints(kind)
