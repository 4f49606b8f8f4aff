"""Who is told when kernels begin to compile; apart from `peaksim.kernel`, which imports Numba."""

from collections.abc import Callable

LISTENERS: list[Callable[[], None]] = []
"""Called once each, before the first kernel is compiled; those that the cache holds are not."""


def tell() -> None:
    """Call the listeners and forget them."""
    while LISTENERS:
        LISTENERS.pop(0)()
