"""Markers and arrays beside ArUco and AprilTag: same printed side, same wall, same camera, same light.

Each trial hangs one sheet on a wall, looks at it under one condition, and asks each detector what it sees.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from time import perf_counter
from typing import Any, Literal, get_args

import cv2
import numpy as np
from numpy.typing import NDArray
from peaksim.camera.models import camera_named
from peaksim.camera.sensor import Sensor, capture_image
from peaksim.geometry.pose import Pose, compose, invert, rotation_about, transform
from peaksim.rendering import render
from peaksim.scene import build as scene_build
from peaksim.scene.scene import Quad, Scene
from peaksim.scene.texture import Texture

from peakmark.arrays.decode import decode_arrays
from peakmark.errors import InputError
from peakmark.experiments.cave.rooms import photographs
from peakmark.identification.both import identify_both
from peakmark.markers.array_code import THREE_BIT, polarities_of
from peakmark.markers.patterns import Polarity, surf_marker

Design = Literal["SURF marker", "SURF array", "ArUco 4×4", "AprilTag 36h11"]
DESIGNS: tuple[Design, ...] = get_args(Design)
TAGS: Mapping[Design, tuple[str, int]] = {
    "ArUco 4×4": ("DICT_4X4_50", 50),
    "AprilTag 36h11": ("DICT_APRILTAG_36h11", 587),
}
"""OpenCV's name of the dictionary, and how many ids it has."""

SIDE_M = 0.05
"""Printed side of a marker and of a tag, its black border included; an array takes 2.5 × 2.5 of them."""

CAMERA = replace(camera_named("sony-dsc-s85"), width=384, height=288, cx=191.5, cy=143.5)
"""The middle of the picture of the paper's second camera."""

_TEXELS = 72
_SHEET = 6
"""Sides of a sheet, in sides of a marker."""


@dataclass(frozen=True)
class Condition:
    """How a sheet is seen."""

    side_px: float = 40.0
    """Side of a marker in the picture, as the root of its area."""
    tilt_deg: float = 0.0
    """Of the sheet against the line of sight."""
    noise: float = 2.0
    """σ of the read noise, grey levels; the exposure is 0.7."""
    blur_px: float = 0.6
    """σ of the lens blur."""
    occluded: float = 0.0
    """Share of the design's width that a grey bar covers, from its left."""


SWEEPS: dict[str, tuple[float, ...]] = {
    "side_px": (8, 10, 12, 14, 16, 20, 28, 40, 64),
    "tilt_deg": (0, 30, 45, 60, 70, 75, 80),
    "noise": (0, 5, 10, 20, 30, 40),
    "blur_px": (0.3, 1, 2, 3, 4, 6, 8),
    "occluded": (0, 0.02, 0.05, 0.1, 0.15, 0.2, 0.3),
}
"""Quantity → values; all others stay at the defaults of `Condition`."""


@dataclass(frozen=True)
class Answer:
    """What one design's detector said about one picture."""

    is_right: bool
    """Whether it found the sheet's design with its id (array: its code; marker: its polarity)."""
    wrong: int
    """Ids, codes or markers that are not there."""
    error_px: float | None
    """Distance of the found centre from the true one; None if not found."""
    seconds: float
    """Of the detector."""


def conditions() -> list[tuple[str, float, Condition]]:
    """Return (quantity, value, condition) of all sweeps."""
    return [
        (quantity, value, replace(Condition(), **{quantity: value}))
        for quantity, values in SWEEPS.items()
        for value in values
    ]


def compare(trials: int, seed: int, on_condition: Callable[[], None] = lambda: None) -> list[dict[str, Any]]:
    """Return one row a condition and design, with counts over the trials.

    Raises
    ------
    InputError
        If the number of trials is not in 1…100000, or the seed is negative.
    """
    if not 1 <= trials <= 100_000:
        raise InputError(f"--trials: expected 1…100000, got {trials}")
    if seed < 0:
        raise InputError(f"--seed: expected 0 or more, got {seed}")
    rows = []
    for number, (quantity, value, condition) in enumerate(conditions()):
        for design in DESIGNS:
            rng = np.random.default_rng((seed, number, DESIGNS.index(design)))
            answers = [trial(design, condition, rng) for _ in range(trials)]
            rows.append({"quantity": quantity, "value": value, "design": design, **_counts(answers)})
        on_condition()
    return rows


def _counts(answers: Sequence[Answer]) -> dict[str, Any]:
    errors = [answer.error_px for answer in answers if answer.error_px is not None]
    return {
        "right": sum(answer.is_right for answer in answers),
        "trials": len(answers),
        "wrong": sum(answer.wrong for answer in answers),
        "error_px_rms": float(np.sqrt(np.mean(np.square(errors)))) if errors else None,
        "error_px_p95": float(np.percentile(errors, 95)) if errors else None,
        "seconds": float(np.median([answer.seconds for answer in answers])),
    }


def trial(design: Design, condition: Condition, rng: np.random.Generator) -> Answer:
    """Hang a sheet with a random id on a random wall, look at it, and ask the design's detector."""
    code = int(rng.integers(count_of(design)))
    scene, pose = _scene(design, code, condition, rng), looking(condition, rng)
    frame = render(scene, CAMERA, pose, renderer="exact")
    gray = capture_image(frame.linear, Sensor(condition.blur_px, exposure=0.7, read_noise=condition.noise), rng)
    center = CAMERA.project(transform(invert(pose), centers_m(design))).mean(axis=0)
    start = perf_counter()
    found = look_for(design, gray)
    seconds = perf_counter() - start
    right = [xy for name, xy in found if name == code and np.linalg.norm(xy - center) <= 0.25 * condition.side_px]
    error = float(np.linalg.norm(right[0] - center)) if right else None
    return Answer(bool(right), len(found) - bool(right), error, seconds)


def count_of(design: Design) -> int:
    """Return the number of different ids: 2 polarities, 8 codes, or the size of the dictionary."""
    return {"SURF marker": 2, "SURF array": 2**THREE_BIT.bits}.get(design) or TAGS[design][1]


def look_for(design: Design, gray: NDArray[np.uint8]) -> list[tuple[int, NDArray[np.float64]]]:
    """Return (id, centre) of everything that the design's detector finds."""
    if design in TAGS:
        return list(_tags(TAGS[design][0], gray))
    found = identify_both(gray).detections
    if design == "SURF marker":
        return [(int(d.polarity == "light"), d.xy) for d in found]
    return [(array.code, array.xy) for array in decode_arrays(found, image=gray) if array.code is not None]


def _tags(dictionary: str, gray: NDArray[np.uint8]) -> Iterator[tuple[int, NDArray[np.float64]]]:
    corners, ids, _ = _tag_detector(dictionary).detectMarkers(gray)
    for quad, name in zip(corners, [] if ids is None else ids.ravel(), strict=True):
        yield int(name), crossing(quad.reshape(4, 2).astype(np.float64))


def _tag_detector(dictionary: str) -> Any:
    parameters = cv2.aruco.DetectorParameters()
    parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    return cv2.aruco.ArucoDetector(tag_dictionary(dictionary), parameters)


def tag_dictionary(name: str) -> Any:
    """Return OpenCV's dictionary of tags."""
    return cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, name))


def crossing(corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the (2,) point where the diagonals of a (4, 2) quadrangle cross: the picture of a square's centre."""
    a, b, c, d = corners
    along, _ = np.linalg.solve(np.column_stack([c - a, b - d]), b - a)
    return np.asarray(a + along * (c - a))


# --- the sheet and the camera -------------------------------------------------------------------------------


def centers_m(design: Design) -> NDArray[np.float64]:
    """Return the (k, 3) centres of what is printed on the sheet; the picture's centre is the mean of their pictures."""
    if design != "SURF array":
        return np.zeros((1, 3))
    cells = (np.array(THREE_BIT.cells) - 0.5) * [1, -1] * THREE_BIT.pitch * SIDE_M
    return np.pad(cells, ((0, 0), (0, 1)))


def width_m(design: Design) -> float:
    """Return the width of what is printed."""
    return SIDE_M * (1 + THREE_BIT.pitch) if design == "SURF array" else SIDE_M


def sheet(design: Design, code: int) -> NDArray[np.uint8]:
    """Return a white sheet with the design in its middle."""
    paper = np.full((_SHEET * _TEXELS, _SHEET * _TEXELS), 255, np.uint8)
    step = THREE_BIT.pitch * _TEXELS / 2
    for pattern, (x, y) in _patterns(design, code, step):
        left, top = (round(_SHEET * _TEXELS / 2 + place - _TEXELS / 2) for place in (x, y))
        paper[top : top + _TEXELS, left : left + _TEXELS] = pattern
    return paper


def _patterns(design: Design, code: int, step: float) -> Iterator[tuple[NDArray[np.uint8], tuple[float, float]]]:
    if design in TAGS:
        yield tag_dictionary(TAGS[design][0]).generateImageMarker(code, _TEXELS), (0.0, 0.0)
        return
    polarities: Sequence[Polarity] = ("light" if code else "dark",)
    cells: Sequence[tuple[float, float]] = ((0.5, 0.5),)
    if design == "SURF array":
        polarities, cells = polarities_of(code), THREE_BIT.cells
    for polarity, (column, row) in zip(polarities, cells, strict=True):
        yield surf_marker(_TEXELS, polarity), ((2 * column - 1) * step, (2 * row - 1) * step)


def _scene(design: Design, code: int, condition: Condition, rng: np.random.Generator) -> Scene:
    photos = photographs("held-out")
    photo = scene_build.scale_contrast(photos[str(rng.choice(list(photos)))], float(rng.uniform(0.3, 1)), 140.0)
    size, sheet_m = (2.5, 2.5), _SHEET * SIDE_M
    away = np.eye(4)
    away[2, 3] = -0.002
    wall = Quad("wall", scene_build.Paper(photo, float(rng.uniform(1.2, 2.5))).cover_surface(size, "wall"), size, away)
    quads = [wall, Quad("sheet", Texture.from_array(sheet(design, code)), (sheet_m, sheet_m), np.eye(4))]
    if condition.occluded > 0:
        bar_m = condition.occluded * width_m(design)
        bar = np.eye(4)
        bar[:3, 3] = bar_m - width_m(design) / 2 - 0.1, 0.0, 0.001
        quads.append(Quad("bar", Texture.from_array(np.full((1, 1), 110, np.uint8)), (0.2, 0.5), bar))
    return Scene(tuple(quads))


def looking(condition: Condition, rng: np.random.Generator) -> Pose:
    """Return a camera at the condition's tilt and distance, from any side, with any roll and sub-pixel phase."""
    tilt = np.radians(condition.tilt_deg)
    distance = CAMERA.fx * SIDE_M * np.sqrt(np.cos(tilt)) / condition.side_px
    turn = rotation_about("z", rng.uniform(0, 360)) @ rotation_about("x", condition.tilt_deg)
    turn = turn @ rotation_about("z", rng.uniform(0, 360)) @ np.diag([1.0, -1.0, -1.0])
    shift = turn[:, :2] @ rng.uniform(-3, 3, 2) * distance / CAMERA.fx
    return compose(turn, -distance * turn[:, 2] + shift)
