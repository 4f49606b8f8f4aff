"""Compares SURF key points with OpenCV's, one to one, and says what the worst pair looks like."""

import json
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from scipy.spatial import cKDTree

from peakmark.keypoints.keypoints import Keypoints
from tests.places import GOLDEN as ALL_GOLDEN

GOLDEN = ALL_GOLDEN / "surf"
IMAGES = ("gravel", "brick", "coins", "marker_dark_513", "marker_light_rot_tilt", "noise_97x64", "uniform")
SETTINGS = ("default", "low", "extended_upright")
MAX_SHIFT_PX = 0.01


def load_image(name: str) -> NDArray[np.uint8]:
    return np.asarray(Image.open(GOLDEN / f"{name}.png"))


def load_expected(name: str, setting: str) -> Keypoints:
    with np.load(GOLDEN / f"{name}.{setting}.npz") as data:
        columns = {key: data[key] for key in data.files if key != "settings"}
    return Keypoints(**columns, scale=columns["size"])


def load_parameters(name: str, setting: str) -> dict[str, float]:
    with np.load(GOLDEN / f"{name}.{setting}.npz") as data:
        settings = json.loads(str(data["settings"]))
    renamed = {"hessianThreshold": "threshold", "nOctaves": "octaves", "nOctaveLayers": "layers"}
    return {renamed.get(key, key): value for key, value in settings.items()}


@dataclass(frozen=True)
class Parity:
    """How two sets of key points agree; the rows of `pairs` are (index in theirs, index in ours)."""

    theirs: int
    ours: int
    pairs: NDArray[np.intp]
    shift_px: NDArray[np.float64]
    response_relative: NDArray[np.float64]
    angle_deg: NDArray[np.float64]
    descriptor: NDArray[np.float64]

    @property
    def same_order(self) -> bool:
        return bool((np.diff(self.pairs[:, 1]) > 0).all())

    def row(self, name: str) -> str:
        worst = [f"{values.max(initial=0):9.2g}" for values in (self.shift_px, self.response_relative, self.angle_deg)]
        counts = f"{self.theirs:6} {self.ours:6} {len(self.pairs):6}"
        return f"{name:40} {counts} {' '.join(worst)} {self.descriptor.max(initial=0):9.2g}"


def compare(theirs: Keypoints, ours: Keypoints) -> Parity:
    """Pair key points of the same size, octave and Laplacian within 0.01 px, each at most once."""
    pairs = np.array(_pair(theirs, ours), dtype=np.intp).reshape(-1, 2)
    a, b = theirs[pairs[:, 0]], ours[pairs[:, 1]]
    angle = np.abs(a.angle.astype(np.float64) - b.angle) % 360
    none = np.zeros(0)
    return Parity(
        theirs=len(theirs),
        ours=len(ours),
        pairs=pairs,
        shift_px=np.abs(a.xy.astype(np.float64) - b.xy).max(axis=1, initial=0),
        response_relative=np.abs(a.response.astype(np.float64) / b.response - 1),
        angle_deg=np.minimum(angle, 360 - angle),
        descriptor=none
        if a.descriptors is None or b.descriptors is None
        else np.linalg.norm(a.descriptors.astype(np.float64) - b.descriptors, axis=1),
    )


def _pair(theirs: Keypoints, ours: Keypoints) -> list[tuple[int, int]]:
    if not len(theirs) or not len(ours):
        return []
    near = cKDTree(ours.xy).query_ball_point(theirs.xy, MAX_SHIFT_PX, p=np.inf)
    kinds = [np.c_[k.size, k.octave, k.laplacian] for k in (theirs, ours)]
    taken: set[int] = set()
    pairs = []
    for i, candidates in enumerate(near):
        fits = [j for j in candidates if j not in taken and (kinds[0][i] == kinds[1][j]).all()]
        if fits:
            j = min(fits, key=lambda j: abs(ours.response[j] - theirs.response[i]))
            taken.add(j)
            pairs.append((i, j))
    return pairs
