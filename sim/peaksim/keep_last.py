"""A cache of one value that never holds two."""

from collections.abc import Callable
from functools import wraps
from typing import Any, TypeVar

Value = TypeVar("Value")


def keep_last(function: Callable[..., Value]) -> Callable[..., Value]:
    """Let a function remember its last value, as `functools.lru_cache(maxsize=1)` does.

    The value is forgotten before another one is computed, so that its memory is free by then.
    """
    kept: list[tuple[tuple[Any, ...], Value]] = []

    @wraps(function)
    def call(*arguments: Any) -> Value:
        last = kept[-1:]
        if last and last[0][0] == arguments:
            return last[0][1]
        kept.clear()
        last.clear()
        value = function(*arguments)
        kept[:] = [(arguments, value)]
        return value

    return call
