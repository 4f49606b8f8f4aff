"""Detectors by name, the user's own included: each is a function (image, **parameters) → Keypoints.

| name | what it is |
|---|---|
| surf | ours, OpenCV's key points; parameters as `surf.detect_and_describe` |
| surf-paper | ours with the marker paper's 4 octaves × 2 layers |
| surf-opencv | OpenCV's own, if this cv2 was built with OPENCV_ENABLE_NONFREE; the same parameters |
| sift | OpenCV's SIFT, centred; `laplacian` is the DoG's sign, `threshold` for contrast; also `layers`, `strongest` |
| sift-opencv | the same as it comes: key points lie 0.25 px too far right and down |
| vlfeat | VLFeat's SIFT through pycolmap; the response is its |DoG|, see `peakmark.detectors.vlfeat` |
| cv2:NAME | any `cv2.Feature2D` that `cv2.NAME_create` makes, such as cv2:ORB; parameters as that function's |
| module:function | a function of yours: see docs/how-to/use-your-own-detector.md |

What a detector does wrong is counted by `peakmark.detectors.outcome`.
"""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from importlib import import_module
from inspect import signature
from operator import attrgetter
from typing import Any

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray
from peaksim.toml_file import suggestion

from peakmark import surf
from peakmark.detectors.dog import dog_responses
from peakmark.detectors.vlfeat import require_vlfeat, vlfeat_sift
from peakmark.errors import InputError
from peakmark.keypoints.image import as_gray
from peakmark.keypoints.keypoints import Keypoints

Detector = Callable[..., Keypoints]

NAMES = ("surf", "surf-paper", "surf-opencv", "sift", "sift-opencv", "vlfeat")
"""Detectors with a name of their own."""


def find_detector(name: str, describe: bool = True) -> Detector:
    """Return a detector by name.

    Parameters
    ----------
    name : one of `NAMES`, "cv2:NAME", or "module:function" for a function of an importable module. That function gets
        the image as the caller has it, and returns what `as_keypoints` takes.
    describe : also describe the key points, where the detector can; the user's own function decides for itself.

    Raises
    ------
    InputError
        If there is no such detector, this OpenCV has no SURF, or pycolmap is missing.
    """
    if name.startswith("cv2:"):
        return partial(opencv_feature, _opencv_maker(name), describe)
    if ":" in name:
        return partial(_detect_with, import_function(name))
    if name not in NAMES:
        raise InputError(f"detector: expected one of {', '.join(NAMES)}, cv2:NAME or module:function, got {name!r}")
    if name == "surf-opencv" and not has_opencv_surf():
        raise InputError("detector surf-opencv: this OpenCV was built without SURF; surf gives the same key points")
    if name == "vlfeat":
        require_vlfeat()

    ours: Detector = surf.detect_and_describe if describe else surf.detect
    known: dict[str, Detector] = {
        "surf": ours,
        "surf-paper": partial(ours, **surf.PAPER),
        "surf-opencv": opencv_surf,
        "sift": partial(opencv_sift, describe=describe),
        "sift-opencv": partial(opencv_sift, describe=describe, centred=False),
        "vlfeat": partial(vlfeat_sift, describe=describe),
    }
    return known[name]


def settings_of(name: str, parameters: Mapping[str, Any]) -> dict[str, Any]:
    """Return all parameters that a detector works with: those given and its defaults.

    Raises
    ------
    InputError
        If the detector is unknown, or does not take one of the parameters.
    """
    detector = signature(find_detector(name))
    try:
        call = detector.bind(None, **parameters)
    except TypeError as error:
        known = list(detector.parameters)[1:]
        if unknown := [key for key in parameters if key not in known]:
            wrong = f"unknown parameter {unknown[0]}{suggestion(unknown[0], known)}"
            raise InputError(f"detector {name}: {wrong}, expected some of {', '.join(known)}") from error
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
    image: ArrayLike,
    threshold: float = 0.04,
    layers: int = 3,
    strongest: int | None = None,
    *,
    describe: bool = True,
    centred: bool = True,
) -> Keypoints:
    """OpenCV's SIFT, strongest first; `enable_precise_upscale`, as key points are off by a quarter pixel without it.

    `response` is OpenCV's, without sign; `laplacian` is the sign of the DoG at the key point: +1 for a dark centre.
    """
    detector = _opencv().SIFT_create(nOctaveLayers=layers, contrastThreshold=threshold, enable_precise_upscale=centred)
    gray = as_gray(image)
    found = _strongest_first(_run_opencv(detector, gray, describe, 128))[:strongest]
    return found.with_columns(laplacian=np.sign(dog_responses(gray, found.xy, found.size / 2)))


def opencv_feature(make: Callable[..., Any], describe: bool, image: ArrayLike, **parameters: Any) -> Keypoints:
    """Key points, strongest first, of what `make(**parameters)` gives, a `cv2.Feature2D`; described if it can.

    Parameters that OpenCV does not take are an `InputError`.
    """
    cv2 = _opencv()
    try:
        detector = make(**parameters)
    except (TypeError, cv2.error) as error:
        raise InputError(f"detector cv2:{make.__name__}: expected its parameters, got {error}") from error
    length = detector.descriptorSize() if describe else 0
    return _strongest_first(_run_opencv(detector, as_gray(image), length > 0, length))


def _run_opencv(detector: Any, gray: NDArray[np.uint8], describe: bool, length: int) -> Keypoints:
    points, descriptors = detector.detectAndCompute(gray, None) if describe else (detector.detect(gray, None), None)
    if describe and descriptors is None:
        descriptors = np.zeros((0, length), np.float32)
    keypoints = Keypoints.from_opencv(points, descriptors)
    is_surf = hasattr(detector, "getHessianThreshold")  # the class ids of others are −1, or count something else
    return keypoints if is_surf else keypoints.with_columns(laplacian=np.zeros(len(keypoints)))


def _strongest_first(keypoints: Keypoints) -> Keypoints:
    return keypoints[np.argsort(-np.abs(keypoints.response), kind="stable")]


def _opencv() -> Any:
    """Return cv2, whose type stubs leave out some detectors."""
    return cv2


def _opencv_maker(name: str) -> Callable[..., Any]:
    """Return `cv2.NAME_create` of "cv2:NAME"."""
    cv2 = _opencv()
    try:
        make: Callable[..., Any] = attrgetter(f"{name.removeprefix('cv2:')}_create")(cv2)
        made = make()
    except AttributeError:
        made = None
    except (TypeError, cv2.error) as error:
        raise InputError(f"detector {name}: expected one that this OpenCV can make, got {error}") from error
    if not isinstance(made, cv2.Feature2D):
        raise InputError(f"detector: expected cv2:NAME of a cv2.Feature2D, got {name!r}")
    return make


def import_function(name: str) -> Callable[..., Any]:
    """Return the function of "module:function"; one that cannot be imported is an `InputError`."""
    module_name, _, function_name = name.partition(":")
    try:
        function: Callable[..., Any] = getattr(import_module(module_name), function_name)
    except (ImportError, AttributeError, ValueError) as error:
        raise InputError(f"detector {name}: cannot be imported ({error}); is its folder on PYTHONPATH?") from error
    if not callable(function):
        raise InputError(f"detector {name}: expected a function, got {type(function).__name__}")
    return function


def _detect_with(function: Callable[..., Any], image: NDArray[Any], **parameters: Any) -> Keypoints:
    return as_keypoints(function(image, **parameters))


def as_keypoints(found: Any, name: str = "detector") -> Keypoints:
    """Return what a user's function found as `Keypoints`.

    Parameters
    ----------
    found
        - `Keypoints`: every column as it is.
        - An (n, 2) array, or a list of (x, y) pairs: positions, strongest first; the other columns are unknown.
        - A sequence of `cv2.KeyPoint`, or a pair of such a sequence and its (n, d) descriptors. Its class ids tell
          polarity, as those of OpenCV's SURF, if one of them is +1: −1 alone is what a `cv2.KeyPoint` has by default.
    name
        What an error calls it.

    Raises
    ------
    InputError
        If it is none of them.
    """
    if isinstance(found, Keypoints):
        return found
    points, descriptors = found, None
    if isinstance(found, tuple) and len(found) == 2 and not hasattr(found[0], "pt") and not _are_pairs(found):
        points, descriptors = found
    if isinstance(points, Sequence) and all(hasattr(point, "pt") for point in points):
        return with_stated_polarity(Keypoints.from_opencv(points, descriptors))
    if descriptors is None and _are_pairs(points):
        xy = np.asarray(points, dtype=np.float32).reshape(-1, 2)
        none = np.zeros(len(xy))
        return Keypoints(xy, none, none - 1, none, none, none, none)  # type: ignore[arg-type]
    raise InputError(
        f"{name}: expected Keypoints, an (n, 2) array of points, or cv2.KeyPoint objects, alone or with descriptors, "
        f"got {_described(found)}"
    )


def _are_pairs(points: Any) -> bool:
    """Whether points are an array or sequence of (x, y)."""
    if not isinstance(points, np.ndarray | Sequence) or isinstance(points, str | bytes):
        return False
    try:
        array = np.asarray(points)
    except ValueError:  # of rows that differ in length
        return False
    return array.size == 0 or (array.ndim == 2 and array.shape[1] == 2 and array.dtype.kind in "iuf")


def _described(found: Any) -> str:
    if isinstance(found, np.ndarray):
        return f"an array of {found.dtype} and shape {found.shape}"
    kinds = {type(part).__name__ for part in found[:1000]} if isinstance(found, list | tuple) else set()
    return type(found).__name__ + (f" of {', '.join(sorted(kinds))}" if kinds else "")


def with_stated_polarity(keypoints: Keypoints) -> Keypoints:
    """Return OpenCV's key points without the polarity that none of them states: their class id is −1 by default."""
    if (keypoints.laplacian == 1).any():
        return keypoints
    return keypoints.with_columns(laplacian=np.zeros(len(keypoints)))
