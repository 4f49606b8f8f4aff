"""Pictures with known content, drawn independently of the renderers."""

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from peaksim.gl import integrate as render_gl

from peakmark.markers.patterns import Polarity, surf_marker

needs_gl = pytest.mark.skipif(not render_gl.is_available(), reason="no OpenGL context opens on this machine")
"""For tests of the OpenGL renderer: a user without sudo may have none."""


def marker_view(
    side_px: float, turn_deg: float = 0.0, polarity: Polarity = "dark", image_px: int = 257
) -> NDArray[np.uint8]:
    """Return a marker in the middle of a plain picture of its border's grey, by 4×4 supersampled warping."""
    fine, texels = 4, 288
    pattern = surf_marker(texels, polarity).astype(np.float32)
    scale = side_px * fine / texels
    warp = cv2.getRotationMatrix2D(((texels - 1) / 2, (texels - 1) / 2), turn_deg, scale)
    warp[:, 2] += (image_px * fine - 1) / 2 - (texels - 1) / 2
    plain = np.full((image_px * fine, image_px * fine), 255.0 if polarity == "dark" else 0.0, np.float32)
    drawn = cv2.warpAffine(pattern, warp, plain.shape[::-1], plain, cv2.INTER_AREA, cv2.BORDER_TRANSPARENT)
    return np.rint(cv2.resize(drawn, (image_px, image_px), interpolation=cv2.INTER_AREA)).astype(np.uint8)
