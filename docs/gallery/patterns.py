"""Eight patterns, two detectors.

SURF's marker and SIFT's, dark and light, as the paper has them (top), and in black and white alone (bottom), where
SIFT's is a plain disc. SURF and SIFT find their own markers; the disc is found by either.
"""

from itertools import product

import numpy as np

from peakmark import identify, overlay
from peakmark.markers.patterns import Variant, marker_image

rows = []
for limit, asked in (("energy", ({"detector": ("surf", "sift")},)), ("range", ({}, {"detector": "surf-disc"}))):
    kinds = [Variant(polarity, limit, made_for) for made_for, polarity in product(("surf", "sift"), ("dark", "light"))]
    row = np.hstack([np.pad(marker_image(144, kind), 36, constant_values=255) for kind in kinds])
    halves = np.split(row, len(asked), axis=1)  # of black and white ones each half is asked for its own
    found = [identify(half, limit=limit, **how) for half, how in zip(halves, asked, strict=True)]
    for one in (one for part in found for one in part):
        print(one.kind)
    rows.append(np.hstack([overlay(half, part).pixels for half, part in zip(halves, found, strict=True)]))
overlay(np.vstack(rows)).save("patterns.png")
