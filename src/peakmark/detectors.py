"""Detectors by name, the user's own included: each is a function (image, **parameters) → Keypoints.

| name | what it is |
|---|---|
| surf | ours, OpenCV's key points; parameters as `surf.detect_and_describe` |
| surf-paper | ours with the marker paper's 4 octaves × 2 layers |
| surf-opencv | OpenCV's own, if this cv2 was built with OPENCV_ENABLE_NONFREE; the same parameters |
| sift | OpenCV's SIFT with centred key points; `threshold` is its contrast threshold, plus `layers`, `strongest` |
| module:function | a function of yours that takes the image and any parameters given |
"""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from importlib import import_module
from inspect import signature
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from peakmark.errors import InputError
from peakmark.gray import as_gray
from peakmark.keypoints import Keypoints

Detector = Callable[..., Keypoints]

NAMES = ("surf", "surf-paper", "surf-opencv", "sift")


def find_detector(name: str) -> Detector:
    """Return a detector by name.

    Parameters
    ----------
    name : one of `NAMES`, or "module:function" for a function of an importable module. That function gets the image
        as the caller has it, and returns `Keypoints`, a sequence of `cv2.KeyPoint`, or such a sequence and its
        descriptors.

    Raises
    ------
    InputError
        If there is no such detector, or this OpenCV has no SURF.
    """
    if ":" in name:
        return partial(_detect_with, _import_function(name))
    if name == "surf-opencv":
        _require_opencv_surf()
    from peakmark import surf

    known: dict[str, Detector] = {
        "surf": surf.detect_and_describe,
        "surf-paper": partial(surf.detect_and_describe, **surf.PAPER),
        "surf-opencv": opencv_surf,
        "sift": opencv_sift,
    }
    if name not in known:
        raise InputError(f"detector: expected one of {', '.join(NAMES)} or module:function, got {name!r}")
    return known[name]


def settings_of(name: str, parameters: Mapping[str, Any]) -> dict[str, Any]:
    """Return all parameters that a detector works with: those given and its defaults.

    Raises
    ------
    InputError
        If the detector is unknown, or does not take one of the parameters.
    """
    try:
        call = signature(find_detector(name)).bind(None, **parameters)
    except TypeError as error:
        raise InputError(f"detector {name}: {error}") from error
    call.apply_defaults()
    settings = {**call.arguments, **call.kwargs}
    return {key: value for key, value in settings.items() if key not in ("image", "kwargs", "parameters")}


def has_opencv_surf() -> bool:
    """Whether this cv2 was built with its own SURF."""
    cv2 = _opencv()
    try:
        cv2.xfeatures2d.SURF_create()
    except (AttributeError, cv2.error):
        return False
    return True


def opencv_surf(
    image: ArrayLike,
    threshold: float = 100.0,
    octaves: int = 4,
    layers: int = 3,
    extended: bool = False,
    upright: bool = False,
    strongest: int | None = None,
    mask: ArrayLike | None = None,
) -> Keypoints:
    """OpenCV's own SURF with our parameters; images above 8.4 megapixels suffer from its 32-bit sums."""
    detector = _opencv().xfeatures2d.SURF_create(threshold, octaves, layers, extended, upright)
    chosen = None if mask is None else np.asarray(mask).astype(np.uint8)
    points, descriptors = detector.detectAndCompute(as_gray(image), chosen)
    if descriptors is None:
        descriptors = np.zeros((0, 128 if extended else 64), dtype=np.float32)
    return Keypoints.from_opencv(points, descriptors)[:strongest]


def opencv_sift(
    image: ArrayLike, threshold: float = 0.04, layers: int = 3, strongest: int | None = None
) -> Keypoints:
    """OpenCV's SIFT, strongest first; `enable_precise_upscale`, as key points are off by a quarter pixel without it."""
    detector = _opencv().SIFT_create(nOctaveLayers=layers, contrastThreshold=threshold, enable_precise_upscale=True)
    points, descriptors = detector.detectAndCompute(as_gray(image), None)
    if descriptors is None:
        descriptors = np.zeros((0, 128), dtype=np.float32)
    keypoints = Keypoints.from_opencv(points, descriptors)
    return keypoints[np.argsort(-keypoints.response, kind="stable")][:strongest]


def _opencv() -> Any:
    """Return cv2, whose type stubs leave out some detectors."""
    import cv2

    return cv2


def _require_opencv_surf() -> None:
    if not has_opencv_surf():
        raise InputError("detector surf-opencv: this OpenCV was built without SURF; surf gives the same key points")


def _import_function(name: str) -> Callable[..., Any]:
    module_name, _, function_name = name.partition(":")
    try:
        function = getattr(import_module(module_name), function_name)
    except (ImportError, AttributeError, ValueError) as error:
        raise InputError(f"detector {name}: cannot be imported ({error}); is its folder on PYTHONPATH?") from error
    if not callable(function):
        raise InputError(f"detector {name}: expected a function, got {type(function).__name__}")
    return function  # type: ignore[no-any-return]


def _detect_with(function: Callable[..., Any], image: NDArray[Any], **parameters: Any) -> Keypoints:
    """Call the user's function and take what it returns as `Keypoints`."""
    found = function(image, **parameters)
    if isinstance(found, Keypoints):
        return found
    if isinstance(found, tuple) and len(found) == 2 and not hasattr(found[0], "pt"):
        return Keypoints.from_opencv(*found)
    if isinstance(found, Sequence) and all(hasattr(point, "pt") for point in found):
        return Keypoints.from_opencv(found)
    raise InputError(
        "detector: expected Keypoints, cv2.KeyPoint objects, or those and descriptors, "
        f"got {type(found).__name__}"
    )
