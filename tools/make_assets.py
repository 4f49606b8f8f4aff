"""Make assets/markers again: `.venv/bin/python tools/make_assets.py`; a test compares the files with this."""

from pathlib import Path
from typing import get_args

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from peakmark.markers.optimum import Limit
from peakmark.markers.patterns import SIFT_SIDE_IN_SIGMA, Polarity, sift_marker, surf_marker
from peakmark.markers.sheet import Print

MARKERS = Path(__file__).resolve().parent.parent / "assets" / "markers"
SIDE_PX = 144
"""16 texels a cell of the SURF marker, 12 a σ of the SIFT marker; one size, so that a poster can hold both."""


def marker_assets() -> dict[str, NDArray[np.uint8]]:
    """Return file name → image of every marker asset, without border."""
    assets = {}
    for limit in get_args(Limit):
        for polarity in get_args(Polarity):
            assets[_file_name("surf", polarity, limit)] = surf_marker(SIDE_PX, polarity, limit)
            sift = sift_marker(SIDE_PX / SIFT_SIDE_IN_SIGMA, SIDE_PX, polarity, limit)
            assets[_file_name("sift", polarity, limit)] = sift
    return assets


def _file_name(pattern: str, polarity: Polarity, limit: Limit) -> str:
    return f"{Print(pattern, float(SIDE_PX), polarity, limit).name}.png"


if __name__ == "__main__":
    MARKERS.mkdir(exist_ok=True)
    for name, image in marker_assets().items():
        Image.fromarray(image).save(MARKERS / name, optimize=True)
