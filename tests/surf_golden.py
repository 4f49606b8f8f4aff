"""Key points as the kernels gave them when Numba compiled them, at commit a8ff718; the C kernels are held to these.

`python -m tests.surf_golden` writes them anew, from whatever kernels there are; `surf/test_golden.py` compares.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from peakmark import surf
from tests.places import GOLDEN
from tests.samples import speckled

PATH = GOLDEN / "native" / "surf.npz"
SETTINGS: dict[str, dict[str, Any]] = {
    "plain": {},
    "paper": {**surf.PAPER, "threshold": 10.0, "extended": True},
    "upright": {"octaves": 5, "layers": 2, "threshold": 0.0, "upright": True},
}


def measure(gray: NDArray[np.uint8]) -> dict[str, NDArray[Any]]:
    """Return the columns of the key points of an image under each of the settings, descriptors of every fourth."""
    columns = {}
    for name, setting in SETTINGS.items():
        found = surf.detect_and_describe(gray, **setting)
        for column, values in found.columns().items():
            columns[f"{name}.{column}"] = values[::4] if column == "descriptors" else values
    return columns


if __name__ == "__main__":
    gray = speckled(300, 421, 7)
    np.savez_compressed(PATH, image=gray, **measure(gray))
