"""Parts of kernels that may round a·b + c once instead of twice; all others are compiled as `peaksim.kernel` says."""

from collections.abc import Callable
from typing import Any

from numba import njit


def contracting_part(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile a function that only kernels call, `peaksim.kernel.part`, with fused multiplication and addition."""
    compiled: Callable[..., Any] = njit(
        nogil=True, error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True, fastmath={"contract"}
    )(function)
    return compiled
