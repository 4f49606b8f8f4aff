"""Detectors by name: ours, OpenCV's, VLFeat's, and the user's own.

=================  ==================================================================================
name               detector
=================  ==================================================================================
surf               our SURF, 4 octaves × 3 layers, OpenCV's default
surf-paper         our SURF, 4 octaves × 2 layers, what the paper used
sift               cv2.SIFT as it comes: key points lie 0.25 px too far right and down
sift-precise       cv2.SIFT with `enable_precise_upscale`
vlfeat             VLFeat's SIFT through pycolmap; the response is the signed DoG, sampled at its frames
cv2:NAME           `cv2.NAME_create()`, any `cv2.Feature2D`, such as cv2:ORB or cv2:AKAZE
module:function    the user's own, (H, W) uint8 → `Keypoints` or a sequence of `cv2.KeyPoint`
=================  ==================================================================================
"""

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from peakmark.errors import InputError
from peakmark.keypoints import Keypoints

Detector = Callable[[NDArray[np.uint8]], Keypoints]

NAMES = ("surf", "surf-paper", "sift", "sift-precise", "vlfeat")
"""Detectors with a name of their own."""

SURF_THRESHOLD = 100.0
"""Hessian threshold of "surf" and "surf-paper", (grey levels)²."""


@dataclass(frozen=True)
class Outcome:
    """What a detector gave for one picture, without what cannot be a key point."""

    keypoints: Keypoints
    """Strongest first; finite and inside the picture."""
    not_finite: int = 0
    """Key points with nan or inf, left out."""
    outside: int = 0
    """Key points outside the picture, left out."""
    failure: str = ""
    """The exception's type and text, where the detector raised one."""


def detector(name: str) -> Detector:
    """Return the detector of a name.

    Raises
    ------
    InputError
        If there is none of that name, or it needs a package that is not installed.
    """
    if name in _MAKERS:
        return _MAKERS[name]()
    prefix, colon, rest = name.partition(":")
    if colon and prefix == "cv2":
        return _opencv(rest)
    if colon and prefix and rest:
        return _user_function(prefix, rest)
    raise InputError(f"detector: expected {', '.join(NAMES)}, cv2:NAME or module:function, got {name!r}")


def run(find: Detector, gray: NDArray[np.uint8]) -> Outcome:
    """Run a detector on one picture; an exception or unusable key points are named and counted, not passed on."""
    try:
        keypoints = find(gray)
    except Exception as error:
        return Outcome(Keypoints.empty(), failure=f"{type(error).__name__}: {error}")
    columns = [keypoints.xy, keypoints.size[:, None], keypoints.response[:, None]]
    finite = np.isfinite(np.concatenate(columns, axis=1)).all(axis=1)
    limit = np.array(gray.shape[1::-1]) - 0.5
    inside = ((keypoints.xy >= -0.5) & (keypoints.xy <= limit)).all(axis=1)
    kept = keypoints[finite & inside]
    order = np.argsort(-np.abs(kept.response), kind="stable")
    return Outcome(kept[order], int((~finite).sum()), int((finite & ~inside).sum()))


def _surf(layers: int) -> Detector:
    from peakmark import surf

    return lambda gray: surf.detect(gray, threshold=SURF_THRESHOLD, octaves=4, layers=layers)


def _sift(precise: bool) -> Detector:
    import cv2

    found: Any = cv2.SIFT_create(enable_precise_upscale=precise)  # type: ignore[attr-defined]
    return lambda gray: _from_opencv(found.detect(gray, None))


def _opencv(name: str) -> Detector:
    import cv2

    create = getattr(cv2, f"{name}_create", None)
    if create is None:
        raise InputError(f"detector: expected cv2:NAME with a cv2.NAME_create, got cv2:{name}")
    try:
        found = create()
    except cv2.error as error:
        raise InputError(f"detector cv2:{name}: expected one this OpenCV can make, got {error}") from error
    if not isinstance(found, cv2.Feature2D):
        raise InputError(f"detector: expected cv2:NAME of a cv2.Feature2D, got {type(found).__name__}")
    return lambda gray: _from_opencv(found.detect(gray, None))


def _from_opencv(points: Any) -> Keypoints:
    return Keypoints.from_opencv(sorted(points, key=lambda point: -abs(point.response)))


def _user_function(module: str, function: str) -> Detector:
    try:
        find = getattr(import_module(module), function)
    except (ImportError, AttributeError) as error:
        raise InputError(f"detector: expected module:function that can be imported, got {error}") from error
    if not callable(find):
        raise InputError(f"detector: expected a function, got {module}:{function}, a {type(find).__name__}")

    def detect(gray: NDArray[np.uint8]) -> Keypoints:
        found = find(gray)
        return found if isinstance(found, Keypoints) else _from_opencv(found)

    return detect


def _vlfeat() -> Detector:
    try:
        import pycolmap
    except ImportError as error:
        raise InputError("detector vlfeat: expected pycolmap; install it: pip install 'peakmark[vlfeat]'") from error
    options = pycolmap.FeatureExtractionOptions()
    options.use_gpu, options.num_threads = False, 1
    options.sift.max_num_orientations = 1
    extractor = pycolmap.FeatureExtractor.create(options)

    def detect(gray: NDArray[np.uint8]) -> Keypoints:
        frames, _ = extractor.extract(pycolmap.Bitmap.from_array(gray))
        xy = np.array([(frame.x - 0.5, frame.y - 0.5) for frame in frames]).reshape(-1, 2)
        scale = np.array([frame.compute_scale() for frame in frames])
        angle = np.degrees([frame.compute_orientation() for frame in frames])
        return signed_by_dog(gray, xy, scale, angle)

    return detect


def signed_by_dog(
    gray: NDArray[np.uint8], xy: NDArray[np.float64], sigma: NDArray[np.float64], angle: NDArray[np.float64]
) -> Keypoints:
    """Return key points at frames (n, 2), σ (n,), strongest first, with |DoG| as response and its sign.

    `laplacian` is +1 where G(2^⅓ σ) − G(σ) is positive: a dark centre, as for SURF.
    """
    response = np.array([dog_response(gray, p, s) for p, s in zip(xy, sigma, strict=True)])
    order = np.argsort(-np.abs(response), kind="stable")
    columns: dict[str, Any] = {
        "xy": xy[order],
        "size": 2 * sigma[order],
        "angle": angle[order] % 360,
        "response": np.abs(response[order]),
        "octave": np.zeros(len(order)),
        "laplacian": np.sign(response[order]),
        "scale": 2 * sigma[order],
    }
    return Keypoints(**columns)


def dog_response(gray: NDArray[np.uint8], xy: NDArray[np.float64], sigma: float) -> float:
    """Return the DoG G(2^⅓ σ) − G(σ) of a picture (0…1) at a place in px, edges repeated."""
    from peakmark.marker import DOG_RATIO

    reach = int(np.ceil(4 * DOG_RATIO * sigma))
    center = np.rint(xy).astype(int)
    offsets = np.arange(-reach, reach + 1)
    rows = np.clip(center[1] + offsets, 0, gray.shape[0] - 1)
    columns = np.clip(center[0] + offsets, 0, gray.shape[1] - 1)
    window = gray[np.ix_(rows, columns)] / 255.0
    lines = [(center[k] + offsets - xy[k]) for k in (0, 1)]
    blurred = [_normal(lines[1], s) @ window @ _normal(lines[0], s) for s in (DOG_RATIO * sigma, sigma)]
    return float(blurred[0] - blurred[1])


def _normal(x: NDArray[np.float64], sigma: float) -> NDArray[np.float64]:
    weights = np.exp(-(x**2) / (2 * sigma**2))
    return np.asarray(weights / weights.sum())


_MAKERS: dict[str, Callable[[], Detector]] = {
    "surf": lambda: _surf(layers=3),
    "surf-paper": lambda: _surf(layers=2),
    "sift": lambda: _sift(precise=False),
    "sift-precise": lambda: _sift(precise=True),
    "vlfeat": _vlfeat,
}
