"""Key points of a COLMAP database, with descriptors, image by image."""

from pathlib import Path
from typing import Any

import numpy as np

from peakmark.detectors.vlfeat import require_vlfeat
from peakmark.errors import InputError
from peakmark.keypoints.keypoints import Keypoints


def read_database(path: str | Path) -> dict[str, Keypoints]:
    """Return image name → its key points, in the database's order, of all images that have any.

    Positions have the centres of pixels at integers, COLMAP's at +½; `size` is 2 σ, `response` and `laplacian` are not
    in a database, and 0. Needs pycolmap.

    Raises
    ------
    InputError
        If pycolmap is missing, or the file is no COLMAP database.
    """
    if not Path(path).is_file():  # COLMAP would make one
        raise InputError(f"{path}: expected a COLMAP database, got no file")
    pycolmap = require_vlfeat()
    try:
        with pycolmap.Database.open(Path(path)) as database:
            return {image.name: _keypoints(database, image.image_id) for image in database.read_all_images()}
    except (RuntimeError, ValueError, TypeError) as error:
        raise InputError(f"{path}: expected a COLMAP database, got {str(error).splitlines()[0]}") from error


def _keypoints(database: Any, image_id: int) -> Keypoints:
    array = np.asarray(database.read_keypoints(image_id), dtype=np.float64)
    found = database.read_descriptors(image_id)
    descriptors = np.asarray(getattr(found, "data", found), dtype=np.float32)
    return from_colmap(array).with_columns(descriptors=descriptors if len(descriptors) else None)


def from_colmap(array: Any) -> Keypoints:
    """Return COLMAP's (n, 4) x, y, scale, angle in radians, or (n, 6) x, y and affinity, as key points."""
    values = np.asarray(array)
    if values.ndim != 2 or values.shape[1] not in (4, 6) or values.dtype.kind not in "iuf":
        raise InputError(f"keypoints: expected (n, 4) or (n, 6) numbers of a COLMAP database, got {values.shape}")
    values = values.astype(np.float64)
    if values.shape[1] == 4:
        sigma, angle = values[:, 2], values[:, 3]
    else:
        sigma = np.sqrt(np.abs(values[:, 2] * values[:, 5] - values[:, 3] * values[:, 4]))
        angle = np.arctan2(values[:, 4], values[:, 2])
    columns: dict[str, Any] = {"xy": values[:, :2] - 0.5, "size": 2 * sigma, "angle": np.degrees(angle) % 360}
    columns |= {name: np.zeros(len(values)) for name in ("response", "octave", "laplacian")}
    return Keypoints(**columns, scale=columns["size"])
