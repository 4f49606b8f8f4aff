"""How Numba compiles the kernels of both packages.

Functions that Python calls are `kernel`s, cached on disk; those that only kernels call are `part`s. A part has no
entry point from Python, which halves the time that a first run spends compiling; `part.py_func` is the plain function.
Literal arguments make Numba compile a part again for each value: pass variables.
"""

from collections.abc import Callable
from typing import Any

from numba import njit
from numba.core.event import Listener, register

from peaksim.compiling import tell


class _Compiling(Listener):  # type: ignore[misc]  # Numba has no types
    """Tells `peaksim.compiling` that a kernel is compiled."""

    def on_start(self, event: object) -> None:
        tell()

    def on_end(self, event: object) -> None:
        pass


register("numba:compile", _Compiling())

_OPTIONS = {"nogil": True, "error_model": "numpy"}
_PART_OPTIONS = {**_OPTIONS, "no_cpython_wrapper": True, "no_cfunc_wrapper": True}


def kernel(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile a function that Python calls."""
    compiled: Callable[..., Any] = njit(cache=True, **_OPTIONS)(function)
    return compiled


def part(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile a function that only kernels call."""
    compiled: Callable[..., Any] = njit(**_PART_OPTIONS)(function)
    return compiled


def contracting_part(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile a part that may round a·b + c once instead of twice."""
    compiled: Callable[..., Any] = njit(fastmath={"contract"}, **_PART_OPTIONS)(function)
    return compiled
