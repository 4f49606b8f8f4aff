"""VLFeat's SIFT, which the marker paper used, through pycolmap; with the signed response that pycolmap leaves out."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from peakmark.detectors.dog import dog_responses
from peakmark.errors import InputError
from peakmark.keypoints.image import as_gray
from peakmark.keypoints.keypoints import Keypoints

_MAX_KEYPOINTS = 1_000_000
"""So many that none is left out: pycolmap's own limit is 8192."""


def require_vlfeat() -> Any:
    """Return the module pycolmap; an `InputError` says how to install it."""
    try:
        import pycolmap
    except ImportError as error:
        raise InputError("detector vlfeat: expected pycolmap; install it: pip install 'peakmark[vlfeat]'") from error
    pycolmap.logging.minloglevel = pycolmap.logging.Level.WARNING.value  # else it announces every extractor
    return pycolmap


def vlfeat_sift(
    image: ArrayLike, threshold: float = 0.02 / 3, strongest: int | None = None, *, describe: bool = True
) -> Keypoints:
    """VLFeat's SIFT, strongest first, one orientation a key point, with (n, 128) descriptors unless told otherwise.

    `threshold` is the smallest |DoG| of a candidate, grey levels 0…1 (pycolmap's default); there are as
    many octaves as the image holds (VLFeat's default), not pycolmap's four. Of the key points `size` is
    2 σ, `response` the |DoG| there and `laplacian` its sign; see `signed_by_dog`. Needs pycolmap (`require_vlfeat`).
    """
    pycolmap = require_vlfeat()
    gray = as_gray(image)
    options = pycolmap.FeatureExtractionOptions()
    options.use_gpu, options.num_threads, options.max_image_size = False, 1, max(gray.shape)
    options.sift.max_num_orientations, options.sift.max_num_features = 1, _MAX_KEYPOINTS
    options.sift.peak_threshold = threshold
    options.sift.num_octaves = max(1, int(np.log2(min(gray.shape))) - options.sift.first_octave - 3)
    frames, descriptors = pycolmap.FeatureExtractor.create(options).extract(pycolmap.Bitmap.from_array(gray))
    # pycolmap's pixel centres are at +0.5
    xy = np.array([(frame.x - 0.5, frame.y - 0.5) for frame in frames]).reshape(-1, 2)
    sigma = np.array([frame.compute_scale() for frame in frames])
    angle = np.degrees([frame.compute_orientation() for frame in frames])
    vectors = np.asarray(descriptors.data, dtype=np.float32).reshape(-1, 128) if describe else None
    return signed_by_dog(gray, xy, sigma, angle, vectors)[:strongest]


def signed_by_dog(
    gray: NDArray[np.uint8],
    xy: NDArray[np.float64],
    sigma: NDArray[np.float64],
    angle_deg: NDArray[np.float64],
    descriptors: NDArray[np.float32] | None = None,
) -> Keypoints:
    """Return key points at frames (n, 2), σ (n,), strongest first, with |DoG| as response and its sign.

    `laplacian` is +1 where G(2^⅓ σ) − G(σ) is positive: a dark centre, as for SURF.
    """
    dog = dog_responses(gray, xy, sigma)
    columns: dict[str, Any] = {
        "xy": xy,
        "size": 2 * sigma,
        "angle": angle_deg % 360,
        "response": np.abs(dog),
        "octave": np.zeros(len(dog)),
        "laplacian": np.sign(dog),
        "scale": 2 * sigma,
        "descriptors": descriptors,
    }
    return Keypoints(**columns)[np.argsort(-np.abs(dog), kind="stable")]
