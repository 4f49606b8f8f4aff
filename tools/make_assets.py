"""Make assets/markers again: `.venv/bin/python tools/make_assets.py`; a test compares the files with this."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from peakmark.markers.patterns import surf_marker

MARKERS = Path(__file__).resolve().parent.parent / "assets" / "markers"
SIDE_PX = 144  # 16 texels a cell


def marker_assets() -> dict[str, NDArray[np.uint8]]:
    """Return file name → picture of every marker asset, without border."""
    return {
        f"surf-{polarity}.png": surf_marker(SIDE_PX, polarity)  # type: ignore[arg-type]
        for polarity in ("dark", "light")
    } | {
        f"surf-range-{polarity}.png": surf_marker(SIDE_PX, polarity, "range")  # type: ignore[arg-type]
        for polarity in ("dark", "light")
    }


if __name__ == "__main__":
    MARKERS.mkdir(exist_ok=True)
    for name, picture in marker_assets().items():
        Image.fromarray(picture).save(MARKERS / name, optimize=True)
