"""Labelled key points of rendered rooms: what the classifiers are trained and evaluated on."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray
from peaksim.camera.camera import resized
from peaksim.camera.frame import Frame, MarkerTruth
from peaksim.camera.sensor import apply_sensor
from peaksim.rendering import render

from peakmark.errors import InputError
from peakmark.experiments.cave.rooms import CAMERAS, Room, Split, photographs, random_room, random_sensor, random_view
from peakmark.identification.evidence import feature_evidence
from peakmark.identification.model import LAYERS
from peakmark.identification.search import detect_features
from peakmark.keypoints.image import as_gray
from peakmark.keypoints.keypoints import Keypoints
from peakmark.score.wanted import FULLY_IN_VIEW, READABLE

SMALLEST_PX = 16.0
"""Side from which a marker is learnt; smaller ones, and hidden ones, are left out of the samples. Below the 20 px from
which a marker must be found, so that the decision is not learnt at its own border."""

CENTER_TOLERANCE = 0.08
"""A key point this near a marker's centre, in sides, but at least `CENTER_TOLERANCE_PX`, is the marker's. Chosen
by hand: about four times the rms error of SURF's key points where it is largest without noise (0.76 px at 40 px)."""

CENTER_TOLERANCE_PX = 2.5
"""Chosen by hand: a little below the 3 px within which a marker counts as found."""

AROUND = 0.75
"""Within so many sides of a marker lie its ghosts and duplicates, which non-maximum suppression removes: neither marker
nor clutter. The ghosts lie at ±0.21 sides and at the border, half a side away; the rest is margin, chosen by hand."""


@dataclass(frozen=True)
class Samples:
    """Key points as rows."""

    evidence: NDArray[np.float64]
    """(n, c) the columns of `classifier.COLUMNS`."""
    is_marker: NDArray[np.bool_]
    """(n,) whether it is the key point of a marker; the others are clutter."""
    room: NDArray[np.int64]
    """(n,) number of the room that it comes from."""
    side_px: NDArray[np.float64]
    """(n,) true side of the marker, nan for clutter."""
    tilt_deg: NDArray[np.float64]
    """(n,) true tilt of the marker, nan for clutter."""
    unseen: int
    """Markers in view, ≥ 20 px and tilted to 45°, that have no key point at their centre."""
    views: int
    """Images that they come from."""


STEEPEST_SEEN_DEG = 50.0
"""Largest tilt of the array that a camera is aimed at, 5° more than arrays must be read at; other walls have any."""


def room_and_frames(
    split: Split, number: int, count: int, seed: int, steepest_deg: float = STEEPEST_SEEN_DEG, size: float = 1.0
) -> tuple[Room, Iterator[Frame]]:
    """Return a random room and the frames, rendered one by one, of random cameras at 0.5–4 m and any roll.

    The images have `size` of their cameras' width and height.
    """
    rng = np.random.default_rng((seed, number))
    room = random_room(rng, photographs(split))
    return room, _frames(rng, room, split, count, steepest_deg, size)


def _frames(
    rng: np.random.Generator, room: Room, split: Split, count: int, steepest_deg: float, size: float
) -> Iterator[Frame]:
    for _ in range(count):
        camera = resized(CAMERAS[split][int(rng.integers(len(CAMERAS[split])))], size)
        pose = random_view(rng, room, rng.uniform(0.5, 4), rng.uniform(0, steepest_deg))
        if pose is not None:
            frame = render(room.scene, camera, pose, renderer="exact")
            yield apply_sensor(frame, random_sensor(rng, split), rng)


def collect_samples(split: Split, room: int, views: int, seed: int, layers: int = LAYERS) -> Samples:
    """Return the labelled key points, with so many layers an octave, of a random room."""
    parts = []
    for frame in room_and_frames(split, room, views, seed)[1]:
        gray = as_gray(frame.image)
        parts.append(label_features(gray, detect_features(gray, layers), frame.truth, room))
    return join_samples(parts)


def save_samples(path: Path, samples: Samples) -> None:
    """Write samples as .npz."""
    columns: dict[str, Any] = {name: np.asarray(value) for name, value in vars(samples).items()}
    np.savez_compressed(path, **columns)


def load_samples(path: Path) -> Samples:
    """Read samples that `save_samples` wrote; anything else is an `InputError`."""
    try:
        with np.load(path, allow_pickle=False) as file:
            columns: dict[str, Any] = {field.name: file[field.name] for field in fields(Samples)}
    except (OSError, KeyError, ValueError, BadZipFile) as error:
        raise InputError(f"{path}: expected samples as this command writes them: {error!r}") from error
    return Samples(**{**columns, "unseen": int(columns["unseen"]), "views": int(columns["views"])})


def join_samples(parts: Sequence[Samples]) -> Samples:
    """Return all parts' rows in one."""
    names = ("evidence", "is_marker", "room", "side_px", "tilt_deg")
    columns = {name: np.concatenate([getattr(part, name) for part in parts]) for name in names}
    return Samples(**columns, unseen=sum(part.unseen for part in parts), views=sum(part.views for part in parts))


def label_features(gray: NDArray[np.uint8], features: Keypoints, truth: Sequence[MarkerTruth], room: int) -> Samples:
    """Return one image's samples: the strongest key point at each marker, and everything away from markers."""
    is_marker, is_left_out = np.zeros(len(features), dtype=bool), np.zeros(len(features), dtype=bool)
    owner, unseen = np.full((len(features), 2), np.nan), 0
    for marker in truth:
        if marker.visible_fraction == 0:
            continue
        gaps = np.linalg.norm(features.xy - marker.center_xy, axis=1)
        is_left_out |= gaps <= AROUND * marker.side_px
        if marker.visible_fraction < FULLY_IN_VIEW or marker.side_px < SMALLEST_PX:
            continue
        own = np.flatnonzero(gaps <= max(CENTER_TOLERANCE * marker.side_px, CENTER_TOLERANCE_PX))
        unseen += len(own) == 0 and READABLE.includes(marker)
        is_marker[own[:1]], owner[own[:1]] = True, (marker.side_px, marker.tilt_deg)
    kept = is_marker | ~is_left_out
    rooms = np.full(int(kept.sum()), room, dtype=np.int64)
    side_px, tilt_deg = owner[kept].T
    return Samples(feature_evidence(gray, features[kept]), is_marker[kept], rooms, side_px, tilt_deg, unseen, 1)
