"""Memory of the tables of a scene's textures, which the next scene takes over: fresh pages cost more than filling them.

A virtual machine may need 0.3 s for the first 140 MB of a floor's table, which the kernel fills in 0.02 s.
"""

import weakref

import numpy as np
from numpy.typing import NDArray

_SPACIOUS = 2
"""Memory of more than so many times what is wanted is given back to the system."""
_spare: list[NDArray[np.float64]] = []


def empty_texels(count: int) -> NDArray[np.float64]:
    """Return (count,) numbers whose values are arbitrary; once nothing refers to them, their memory is used again."""
    memory = _spare.pop() if _spare else np.empty(count)
    if not count <= len(memory) <= _SPACIOUS * count:
        memory = np.empty(count)
    texels = np.frombuffer(memory.data, dtype=np.float64, count=count)
    weakref.finalize(texels, _keep, memory)
    return texels


def _keep(memory: NDArray[np.float64]) -> None:
    """Keep memory that nothing refers to any more, in place of what was kept before."""
    _spare[:] = [memory]
