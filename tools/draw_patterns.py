"""Draw docs/images/patterns.png, the markers of the paper and the binary ones: `python tools/draw_patterns.py`."""

from pathlib import Path

import numpy as np
from PIL import Image

from peakmark.markers.patterns import sift_marker, surf_marker

IMAGES = Path(__file__).resolve().parents[1] / "docs/images"
SIDE_PX, GAP_PX = 144, 24

if __name__ == "__main__":
    patterns = [
        surf_marker(SIDE_PX, "dark"),
        surf_marker(SIDE_PX, "light"),
        sift_marker(12, SIDE_PX, "dark"),
        surf_marker(SIDE_PX, "dark", "range"),
        surf_marker(SIDE_PX, "light", "range"),
        sift_marker(12, SIDE_PX, "dark", "range"),
    ]
    framed = [np.pad(np.pad(p, 1), GAP_PX // 2, constant_values=255) for p in patterns]
    Image.fromarray(np.hstack(framed)).save(IMAGES / "patterns.png", optimize=True)
