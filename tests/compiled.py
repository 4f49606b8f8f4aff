"""Parts of kernels have no entry from Python; tests compile one for themselves."""

from collections.abc import Callable
from typing import Any

from peaksim.kernel import kernel


def callable_part(part: Any) -> Callable[..., Any]:
    """Compile a part's source anew, with an entry from Python."""
    return kernel(part.py_func)
