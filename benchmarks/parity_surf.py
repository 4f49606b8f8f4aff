"""Parity with OpenCV's own SURF, key point by key point: `make parity`, where cv2 was built with it.

Prints the table of README.md: their key points, ours, how many pair up (same size, octave and Laplacian, within
0.01 px), whether the order is the same, the worst position, response and angle, and the distances of descriptors.
"""

import sys
from collections.abc import Mapping
from typing import Any

import numpy as np
from images import Image, parity_images

from peakmark import surf
from peakmark.detectors.registry import has_opencv_surf, opencv_surf
from tests.peakmark.surf.parity import Parity, compare

SETTINGS: dict[str, Mapping[str, Any]] = {
    "default": {},
    "low threshold": {"threshold": 10.0},
    "extended, upright, 4×2": {"threshold": 100.0, "extended": True, "upright": True, **surf.PAPER},
}
HEADER = (
    "image | setting | theirs | ours | paired | same order | worst xy, px | worst response, relative "
    "| worst angle, ° | descriptor median | 99 % | worst"
)


def main() -> None:
    """Print a row for each image and setting, and a last one for all."""
    if not has_opencv_surf():
        sys.exit("parity_surf: expected a cv2 built with OPENCV_ENABLE_NONFREE, see benchmarks/README.md")
    print(f"| {HEADER} |\n|{'---|' * (HEADER.count('|') + 1)}")
    every = []
    for name, gray in parity_images().items():
        for setting, parameters in SETTINGS.items():
            every.append(parity(gray, parameters))
            print(f"| {name} | {setting} | {row(every[-1])} |", flush=True)
    print(f"| **all** | | {row(joined(every))} |")


def parity(gray: Image, parameters: Mapping[str, Any]) -> Parity:
    """Compare both detectors on one image."""
    return compare(opencv_surf(gray, **parameters), surf.detect_and_describe(gray, **parameters))


def row(found: Parity) -> str:
    """Figures of one comparison as cells of the table."""
    worst = (found.shift_px, found.response_relative, found.angle_deg)
    shares = np.quantile(found.descriptor, [0.5, 0.99, 1.0]) if len(found.descriptor) else np.zeros(3)
    cells = [f"{values.max(initial=0):.2g}" for values in worst] + [f"{share:.2g}" for share in shares]
    counts = f"{found.theirs} | {found.ours} | {len(found.pairs)} | {'yes' if found.same_order else 'no'}"
    return f"{counts} | {' | '.join(cells)}"


def joined(every: list[Parity]) -> Parity:
    """All comparisons as one; the order is the same where it is in each."""
    ordered = all(found.same_order for found in every)
    count = sum(len(found.pairs) for found in every)
    ranks = np.arange(count) if ordered else -np.arange(count)
    return Parity(
        theirs=sum(found.theirs for found in every),
        ours=sum(found.ours for found in every),
        pairs=np.column_stack([ranks, ranks]),
        **{
            name: np.concatenate([getattr(found, name) for found in every])
            for name in ("shift_px", "response_relative", "angle_deg", "descriptor")
        },
    )


if __name__ == "__main__":
    main()
