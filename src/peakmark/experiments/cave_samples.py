"""Labelled key points of rendered rooms: what the classifier is trained and judged on."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from peaksim.frame import Frame, MarkerTruth
from peaksim.rendering import render
from peaksim.sensor import apply_sensor

from peakmark.classification import evidence
from peakmark.experiments.cave_rooms import CAMERAS, Split, photographs, random_room, random_sensor, random_view
from peakmark.gray import as_gray
from peakmark.identification_both import features_of
from peakmark.keypoints import Keypoints
from peakmark.score import FULLY_IN_VIEW

SMALLEST_PX = 16.0
"""Side from which a marker is learnt; smaller ones, and hidden ones, are left out of the samples."""

CENTER_TOLERANCE = 0.08
"""A key point this near a marker's centre, in sides, but at least `CENTER_TOLERANCE_PX`, is the marker's."""

CENTER_TOLERANCE_PX = 2.5

AROUND = 0.75
"""Within so many sides of a marker lie its ghosts and duplicates, which merging removes: neither marker nor clutter."""


@dataclass(frozen=True)
class Samples:
    """Key points as rows."""

    evidence: NDArray[np.float64]
    """(n, c) the columns of `classification.COLUMNS`."""
    is_marker: NDArray[np.bool_]
    """(n,) whether it is the key point of a marker; the others are clutter."""
    room: NDArray[np.int64]
    """(n,) number of the room that it comes from."""
    side_px: NDArray[np.float64]
    """(n,) true side of the marker, nan for clutter."""
    tilt_deg: NDArray[np.float64]
    """(n,) true tilt of the marker, nan for clutter."""
    unseen: int
    """Markers in view that have no key point at their centre."""


def views(split: Split, rooms: Sequence[int], views_per_room: int, seed: int) -> Iterator[tuple[int, Frame]]:
    """Yield (room, frame) of random rooms, each seen by random cameras from 0.5–4 m at tilts to 50°."""
    photos = photographs(split)
    for number in rooms:
        rng = np.random.default_rng((seed, number))
        room = random_room(rng, photos)
        for _ in range(views_per_room):
            camera = CAMERAS[split][int(rng.integers(len(CAMERAS[split])))]
            pose = random_view(rng, room, rng.uniform(0.5, 4), rng.uniform(0, 50))
            if pose is not None:
                frame = render(room.scene, camera, pose, renderer="exact")
                yield number, apply_sensor(frame, random_sensor(rng, split), rng)


def collect(split: Split, rooms: Sequence[int], views_per_room: int, seed: int) -> Samples:
    """Return the labelled key points of random rooms."""
    parts = []
    for number, frame in views(split, rooms, views_per_room, seed):
        gray = as_gray(frame.image)
        parts.append(label(gray, features_of(gray), frame.truth, number))
    return joined(parts)


def joined(parts: Sequence[Samples]) -> Samples:
    """Return all parts' rows in one."""
    return Samples(
        evidence=np.concatenate([part.evidence for part in parts]),
        is_marker=np.concatenate([part.is_marker for part in parts]),
        room=np.concatenate([part.room for part in parts]),
        side_px=np.concatenate([part.side_px for part in parts]),
        tilt_deg=np.concatenate([part.tilt_deg for part in parts]),
        unseen=sum(part.unseen for part in parts),
    )


def label(gray: NDArray[np.uint8], features: Keypoints, truth: Sequence[MarkerTruth], room: int) -> Samples:
    """Return one picture's samples: the strongest key point at each marker, and everything away from markers."""
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
        unseen += len(own) == 0
        is_marker[own[:1]], owner[own[:1]] = True, (marker.side_px, marker.tilt_deg)
    kept = is_marker | ~is_left_out
    rooms = np.full(int(kept.sum()), room, dtype=np.int64)
    side_px, tilt_deg = owner[kept].T
    return Samples(evidence(gray, features[kept]), is_marker[kept], rooms, side_px, tilt_deg, unseen)
