"""A marker or an array as one row of plain values, the same in CSV, JSON lines, Parquet and data frames."""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from peaksim.camera.camera import Camera

from peakmark.arrays.decode import MarkerArray
from peakmark.found.outline import outline_px
from peakmark.identification.detection import Detection
from peakmark.localise.residuals import refined_sigmas
from peakmark.markers.patterns import Polarity

Corner = tuple[float, float]


@dataclass(frozen=True)
class FoundRow:
    """One marker, or one array of markers, in one image. Positions are px, pixel centres at integers."""

    file: str
    """The image or film as it was named."""
    frame: int | None
    """Number of the frame from 0 in a film or of a camera; None in an image."""
    kind: Literal["array", "marker"]
    """What it is."""
    code: int | None
    """The number that an array carries; None for markers, and where the decoder is unsure."""
    polarity: Polarity | None
    """"dark" or "light" centre of a marker; None for arrays."""
    x: float
    y: float
    """Centre of a marker; mean of an array's centres."""
    side_px: float
    """Square root of the area of a marker's pattern; the mean over an array's markers."""
    probability: float | None
    """That a marker is one, 0…1; of an array the least of its markers'."""
    sigma_px: float | None
    """Expected error of a marker's centre along each axis; None where it is not refined, and for arrays."""
    corners: tuple[Corner, Corner, Corner, Corner]
    """Of the pattern, or around the array from its blank corner, clockwise in the image."""
    doubt: str
    """Why an array has no code; otherwise empty."""
    x_undistorted: float | None = None
    y_undistorted: float | None = None
    """Where a pinhole camera with the same matrix would see the centre; None without a calibration."""
    pattern: str | None = None
    """Which marker it is, such as "surf-dark" or "sift-range-light", see `Detection.kind`; None for arrays."""


def undistorted(row: FoundRow, camera: Camera) -> FoundRow:
    """Return a row with the undistorted centre, too; nan, beyond what the lens shows, is left out."""
    ray = camera.unproject([(row.x, row.y)])[0]
    if not ray[2] > 0:
        return row
    x, y = camera.matrix[:2] @ (ray / ray[2])
    return replace(row, x_undistorted=float(x), y_undistorted=float(y))


def marker_row(marker: Detection, file: str = "", frame: int | None = None) -> FoundRow:
    """Return the row of a marker."""
    return FoundRow(
        file=file,
        frame=frame,
        kind="marker",
        code=None,
        polarity=marker.polarity,
        x=float(marker.xy[0]),
        y=float(marker.xy[1]),
        side_px=float(marker.size),
        probability=marker.probability,
        sigma_px=None if marker.affinity is None else float(refined_sigmas(marker.affinity[None])[0][0]),
        corners=_corners(marker.corners()),
        doubt="",
        pattern=marker.kind,
    )


def array_row(array: MarkerArray, file: str = "", frame: int | None = None) -> FoundRow:
    """Return the row of an array."""
    likely = [d.probability for d in array.detections if d.probability is not None]
    return FoundRow(
        file=file,
        frame=frame,
        kind="array",
        code=array.code,
        polarity=None,
        x=float(array.xy[0]),
        y=float(array.xy[1]),
        side_px=float(np.mean([d.size for d in array.detections])),
        probability=min(likely, default=None),
        sigma_px=None,
        corners=_corners(outline_px(array)),
        doubt=array.doubt,
    )


def _corners(xy: NDArray[np.float64]) -> tuple[Corner, Corner, Corner, Corner]:
    a, b, c, d = ((float(x), float(y)) for x, y in xy)
    return a, b, c, d
