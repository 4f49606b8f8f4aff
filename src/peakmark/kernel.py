"""How this package compiles its kernels: cached on disk, without the GIL, dividing as NumPy does."""

from functools import partial
from typing import Any

from numba import njit

kernel: Any = partial(njit, cache=True, nogil=True, error_model="numpy")
"""Decorator for a kernel; a test of each divisor against zero would keep loops from being vectorised."""

contracting_kernel: Any = partial(kernel, fastmath={"contract"})
"""Decorator for a kernel that may round a·b + c once instead of twice."""
