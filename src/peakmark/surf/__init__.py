"""SURF, key point for key point OpenCV's, in plain Python and C.

Stages can be called alone or together::

    integral_image ─▶ hessian_responses ─▶ interest_points ─▶ orientations ─▶ describe
    └───────────────────── detect ──────────────────────────────────────┘        │
    └───────────────────── detect_and_describe ──────────────────────────────────┘

Bay, Ess, Tuytelaars and Van Gool, "Speeded-Up Robust Features (SURF)", 2008, doi:10.1016/j.cviu.2007.09.014; details
as OpenCV 4's `xfeatures2d.SURF`.

Images are grey or RGB (not BGR), see `peakmark.keypoints.as_gray`. Pixel centres are at integers.

Patents: SURF is covered by US 8,165,401 and US 8,670,619, whose base terms run to 2027 or later. Whether you need a
licence for your use is for you to decide.
"""

from peakmark.surf.api import (
    OPENCV,
    PAPER,
    LayerResponse,
    describe,
    detect,
    detect_and_describe,
    hessian_responses,
    integral_image,
    interest_points,
    orientations,
)

__all__ = [
    "OPENCV",
    "PAPER",
    "LayerResponse",
    "describe",
    "detect",
    "detect_and_describe",
    "hessian_responses",
    "integral_image",
    "interest_points",
    "orientations",
]
