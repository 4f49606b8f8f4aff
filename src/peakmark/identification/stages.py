"""What each stage of an alignment says for a marker, before the next one: figures that a screen asks.

The stages are those of `refine.lit`: the softened image, its own pixels, and the softened image again, in parts.
"""

import numpy as np
from numpy.typing import NDArray

from peakmark.refine.lit import CUT, NOISE, RAMP, RATIO, STEP

Values = NDArray[np.float64]

STAGES = ("soft", "sharp", "parts")
"""After which a candidate may be given up."""

STAGE_COLUMNS = (
    *("left", "noise", "ratio", "step", "cut", "ramp"),
    *("gain_to_noise", "gain", "offset", "tone", "gain_slope", "offset_slope"),
    *("size_ratio", "moved", "anisotropy", "perspective", "blur"),
)
"""Of a fit: logs of the residuals' mean square over gain² and over the noise's, and of the softened image's ratio
(`refine.lit.RATIO`); log of the last step; its cut, which after the parts is the share that is seen; whether there is
a ramp. Of the light: logs of gain over noise and of gain, offset over gain, ln γ, slopes of gain and offset. Of the
shape: log of the side over the candidate's, distance moved in sides, anisotropy, perspective, and the blur's variance,
sides²."""


def stage_columns(xy: Values, sides_px: Values, sigma: float, theta: Values, fits: Values) -> Values:
    """Return (n, len(STAGE_COLUMNS)) of fits (n, 5), with parameters (n, 18), of candidates in an image of noise σ."""
    areas = np.maximum(np.abs(theta[:, 2] * theta[:, 5] - theta[:, 3] * theta[:, 4]), 1e-6)
    sides, gain, noise = np.sqrt(areas), np.maximum(theta[:, 8], 1.0), np.maximum(fits[:, NOISE], 1e-3)
    return np.column_stack(
        [
            *(np.log(noise / gain**2), np.log(noise / sigma**2), np.log(np.clip(fits[:, RATIO], 1e-6, 10.0))),
            *(np.log10(np.clip(fits[:, STEP], 1e-2, 1e3)), fits[:, CUT], fits[:, RAMP]),
            *(np.log(gain / sigma), np.log(gain), theta[:, 9] / gain, theta[:, 15]),
            *(np.hypot(theta[:, 11], theta[:, 12]), np.hypot(theta[:, 13], theta[:, 14])),
            *(np.log(sides / sides_px), np.hypot(*(theta[:, :2] - xy).T) / sides_px),
            *((theta[:, 2:6] ** 2).sum(axis=1) / areas, np.hypot(theta[:, 6], theta[:, 7]), theta[:, 10] / areas),
        ]
    )
