"""Make assets/markers again: `.venv/bin/python tools/make_assets.py`; a test compares the files with this."""

from pathlib import Path
from typing import get_args

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from peakmark.markers.optimum import Limit
from peakmark.markers.patterns import Polarity, surf_marker

MARKERS = Path(__file__).resolve().parent.parent / "assets" / "markers"
SIDE_PX = 144  # 16 texels a cell
STEMS = {"energy": "surf", "range": "surf-range"}
"""Limit → how its files' names begin."""


def marker_assets() -> dict[str, NDArray[np.uint8]]:
    """Return file name → image of every marker asset, without border."""
    return {
        f"{STEMS[limit]}-{polarity}.png": surf_marker(SIDE_PX, polarity, limit)
        for limit in get_args(Limit)
        for polarity in get_args(Polarity)
    }


if __name__ == "__main__":
    MARKERS.mkdir(exist_ok=True)
    for name, image in marker_assets().items():
        Image.fromarray(image).save(MARKERS / name, optimize=True)
