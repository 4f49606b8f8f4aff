"""One image's outcome: which of its markers, arrays and tags each detector found, and what it made up."""

from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from time import process_time
from typing import Literal, TypeVar

import numpy as np
from numpy.typing import NDArray

from peakmark.arrays.decode import MarkerArray, decode_arrays
from peakmark.experiments.images.peers import SeenTag, open_peer
from peakmark.experiments.images.truth import USUAL, Sought, TrueImage, TrueMarker
from peakmark.identification.api import identify
from peakmark.identification.detection import Detection

WITHIN = 0.15
"""A marker is found by a detection this near to its centre, in sides, or `WITHIN_PX`, whichever is more."""
WITHIN_PX = 2.0

BESIDE = 0.75
"""Detections this near to a marker's centre, in sides, are not counted as false: it was seen, if not rightly."""

WHOLE = 0.97
"""Visible share from which a marker counts as whole."""

Result = TypeVar("Result")

Paper = Literal["flat", "bent", "covered", "cut"]


@dataclass(frozen=True)
class MarkerOutcome:
    """What became of one marker."""

    polarity: str
    limit: str
    xy: tuple[float, float]
    side_px: float
    tilt_deg: float
    paper: Paper
    """"flat" and whole, "bent", "covered" to at most a half, or "cut": covered more, or by the image's border."""
    is_found: bool
    error_px: float | None
    """Distance of the detection from the true centre; None if not found."""
    is_wrong: bool
    """Whether it was found as one of the other polarity."""


@dataclass(frozen=True)
class ArrayOutcome:
    """What became of one array."""

    code: int
    xy: tuple[float, float]
    side_px: float
    """Mean side of its markers."""
    tilt_deg: float
    is_whole: bool
    """Whether all of its markers are flat and whole."""
    read: tuple[int, ...]
    """Codes that were read there."""


@dataclass(frozen=True)
class TagOutcome:
    """What became of one tag, by peer."""

    side_px: float
    tilt_deg: float
    is_whole: bool
    error_px: dict[str, float | None]
    """Distance of what each peer found from the true centre; None if not found."""


@dataclass(frozen=True)
class ImageOutcome:
    """One image's result."""

    file: str
    markers: tuple[MarkerOutcome, ...]
    arrays: tuple[ArrayOutcome, ...]
    tags: tuple[TagOutcome, ...]
    false_xy: tuple[tuple[float, float, float], ...]
    """x, y and side, px, of detections beside all markers."""
    false_codes: int
    """Codes read where there is no array."""
    false_tags: dict[str, int]
    """Tags that each peer made up."""
    cpu_s: dict[str, float]
    """Processor time by detector, "identify" and "arrays" among them."""


def evaluate_image(
    truth: TrueImage, gray: NDArray[np.uint8], peers: Sequence[str], sought: Sought = USUAL
) -> ImageOutcome:
    """Return what `identify`, `decode_arrays` and the peers find in an image, scored against its truth."""
    cpu_s: dict[str, float] = {}
    found = _timed(cpu_s, "identify", lambda: identify(gray, detector=sought.detector, limit=sought.limit))
    arrays = _timed(cpu_s, "arrays", lambda: decode_arrays(found, image=gray))
    seen = {name: _timed(cpu_s, name, partial(open_peer(name), gray)) for name in peers}
    groups = arrays_of(truth.markers)
    outcomes, false_codes = _score_arrays(groups, arrays)
    return ImageOutcome(
        truth.file,
        tuple(_score_marker(marker, found) for marker in truth.markers),
        outcomes,
        tuple(
            TagOutcome(
                tag.side_px,
                tag.tilt_deg,
                tag.visible >= WHOLE,
                {name: _tag_error(np.array(tag.xy), tag.id, tag.side_px, tags) for name, tags in seen.items()},
            )
            for tag in truth.tags
        ),
        tuple((float(d.xy[0]), float(d.xy[1]), d.size) for d in found if not _is_beside(d.xy, truth.markers)),
        false_codes,
        {name: sum(t.id not in {tag.id for tag in truth.tags} for t in tags) for name, tags in seen.items()},
        cpu_s,
    )


def _timed(cpu_s: dict[str, float], name: str, work: Callable[[], Result]) -> Result:
    start = process_time()
    result = work()
    cpu_s[name] = process_time() - start
    return result


def paper_of(marker: TrueMarker) -> Paper:
    """Return how a marker is to be counted."""
    if marker.inside < 1 or marker.visible < 0.5:
        return "cut"
    if marker.visible < WHOLE:
        return "covered"
    return "bent" if marker.bent else "flat"


def _score_marker(marker: TrueMarker, found: Sequence[Detection]) -> MarkerOutcome:
    gaps = [float(np.linalg.norm(d.xy - marker.xy)) for d in found]
    nearest = int(np.argmin(gaps)) if gaps else -1
    is_found = bool(gaps) and gaps[nearest] < max(WITHIN * marker.side_px, WITHIN_PX)
    return MarkerOutcome(
        marker.polarity,
        marker.limit,
        marker.xy,
        marker.side_px,
        marker.tilt_deg,
        paper_of(marker),
        is_found,
        gaps[nearest] if is_found else None,
        is_found and found[nearest].polarity != marker.polarity,
    )


def _is_beside(xy: NDArray[np.float64], markers: Sequence[TrueMarker]) -> bool:
    return any(np.linalg.norm(xy - marker.xy) < BESIDE * marker.side_px for marker in markers)


def arrays_of(markers: Sequence[TrueMarker]) -> list[list[TrueMarker]]:
    """Return the markers of every array that has a code."""
    groups: dict[str, list[TrueMarker]] = defaultdict(list)
    for marker in markers:
        if marker.group is not None and marker.code is not None:
            groups[marker.group].append(marker)
    return list(groups.values())


def _score_arrays(
    groups: Sequence[Sequence[TrueMarker]], arrays: Sequence[MarkerArray]
) -> tuple[tuple[ArrayOutcome, ...], int]:
    """Return what was read of each array, and how many codes belong to none."""
    read = [array for array in arrays if array.code is not None]
    taken: set[int] = set()
    outcomes = []
    for members in groups:
        center = np.mean([m.xy for m in members], axis=0)
        side = float(np.mean([m.side_px for m in members]))
        near = [k for k, array in enumerate(read) if np.linalg.norm(array.xy - center) < 2 * side]
        taken.update(near)
        is_whole = len(members) == 3 and all(paper_of(m) == "flat" for m in members)
        codes = tuple(int(c) for k in near if (c := read[k].code) is not None)
        tilt, code = float(np.mean([m.tilt_deg for m in members])), members[0].code
        assert code is not None
        outcomes.append(ArrayOutcome(code, (float(center[0]), float(center[1])), side, tilt, is_whole, codes))
    return tuple(outcomes), len(read) - len(taken)


def _tag_error(xy: NDArray[np.float64], number: int, side_px: float, seen: Sequence[SeenTag]) -> float | None:
    gaps = [float(np.linalg.norm(tag.xy - xy)) for tag in seen if tag.id == number]
    return min(gaps) if gaps and min(gaps) < 0.5 * side_px else None
