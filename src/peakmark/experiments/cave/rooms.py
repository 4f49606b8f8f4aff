"""Random rooms full of posters, random cameras and sensors: what the classifier learns from and is evaluated on.

Rooms of the two splits share no photograph, no camera and no kind of noise.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Literal, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray
from peaksim.camera.camera import Camera
from peaksim.camera.models import camera_named
from peaksim.camera.sensor import Sensor
from peaksim.geometry.pose import Pose, compose, rotation_about
from peaksim.scene import schema
from peaksim.scene.build_meshes import build_meshes
from peaksim.scene.build_quads import quad_pose, room_quads
from peaksim.scene.paper import Paper, scale_contrast
from peaksim.scene.posters import poster_copies
from peaksim.scene.scene import Mesh, Quad, Scene

from peakmark.errors import InputError
from peakmark.experiments.photographs import load_photograph
from peakmark.markers.array_code import polarities_of

Split = Literal["training", "held-out"]

PHOTOGRAPHS: Mapping[Split, tuple[str, ...]] = {
    "training": ("brick", "gravel", "astronaut", "camera", "coins", "page", "moon", "retina", "text"),
    "held-out": (
        *("grass", "coffee", "chelsea", "rocket", "hubble_deep_field", "stereo_motorcycle", "clock"),
        *("china.jpg", "flower.jpg"),
    ),
}
"""See `load_photograph`."""


class Printed(NamedTuple):
    """What posters with markers are printed with."""

    dark: str = "surf-dark"
    light: str = "surf-light"
    """Kinds of the markers."""
    darkest_paper: float = 225.0
    """Least level of the paper, up to 255; what is white in a marker has 255, so that below it the paper is darker."""


SURF = Printed()
"""The paper's markers."""


WIDE, TALL = (3.8, 6.0), (2.4, 3.0)
"""Ranges of a room's width and depth, and of its height, metres: living rooms that hold a distance of 4 m."""

SIDE_M = (0.040, 0.070)
"""Range of the arrays' marker sides: an array of the largest fits an A4 sheet."""

_PHOTO_PX = 512
"""Width to which larger photographs are reduced."""

_SLOT_M = 0.5
"""Between posters, which are at most 0.42 m wide and hang up to 0.08 m beside their slot."""

_GAP_M = 0.002
"""Before the wall, so that neither renderer takes posters and wall for one plane."""


@cache
def photographs(split: Split) -> dict[str, NDArray[np.uint8]]:
    """Return name → (h, w) uint8 grey photographs, reduced; an unknown split is an `InputError`."""
    if split not in PHOTOGRAPHS:
        raise InputError(f"split: expected {' or '.join(PHOTOGRAPHS)}, got {split!r}")
    return {name: _photograph(name) for name in PHOTOGRAPHS[split]}


def _photograph(name: str) -> NDArray[np.uint8]:
    grey = load_photograph(name)
    shrink = max(1.0, grey.shape[1] / _PHOTO_PX)
    size = (round(grey.shape[1] / shrink), round(grey.shape[0] / shrink))
    return np.asarray(cv2.resize(grey, size, interpolation=cv2.INTER_AREA), dtype=np.uint8)


@dataclass(frozen=True)
class Room:
    """A random room."""

    scene: Scene
    min_m: NDArray[np.float64]
    max_m: NDArray[np.float64]
    """(3,) opposite corners."""
    arrays: tuple[str, ...]
    """Names of the quads that carry one 3-bit array."""


def random_room(rng: np.random.Generator, photos: Mapping[str, NDArray[np.uint8]], printed: Printed = SURF) -> Room:
    """Return a room with photographic walls, each of the eight arrays once, other posters and furniture.

    In half of the rooms all arrays hang on one wall. Of two rooms with equal generators only what is printed differs.
    """
    size = np.array([*rng.uniform(*WIDE, 2), rng.uniform(*TALL)])
    papers = {name: _paper(rng, photos) for name in ("floor", "ceiling", "x0", "x1", "y0", "y1")}
    table = schema.RoomTable(
        min_m=(0.0, 0.0, 0.0), max_m=_triple(size), floor="floor", ceiling="ceiling", walls=("x0", "x1", "y0", "y1")
    )
    slots = _slots(rng, size)
    if rng.random() < 0.5:
        wall = slots[-1].normal
        slots.sort(key=lambda slot: slot.normal == wall)
    posters = [_array_poster(rng, code, slots.pop(), printed) for code in range(8)]
    slots = [slots[i] for i in rng.permutation(len(slots))]
    others = [quad for k in range(len(slots) // 3) for quad in _other_poster(rng, k, slots.pop(), photos, printed)]
    quads = (*room_quads(table, papers), *posters, *others)
    scene = Scene(quads, tuple(_furniture(rng, size)))
    return Room(scene, np.zeros(3), size, tuple(quad.name for quad in posters))


def _triple(values: NDArray[np.float64]) -> tuple[float, float, float]:
    return float(values[0]), float(values[1]), float(values[2])


def _paper(rng: np.random.Generator, photos: Mapping[str, NDArray[np.uint8]]) -> Paper:
    photo = photos[str(rng.choice(list(photos)))]
    contrast, mean = rng.uniform(0.2, 1.0), rng.uniform(80, 200)
    return Paper(scale_contrast(photo, contrast, mean), float(rng.uniform(1.2, 2.5)))


@dataclass(frozen=True)
class _Slot:
    """Where one poster may hang."""

    center_m: tuple[float, float, float]
    normal: tuple[float, float, float]
    """Of the poster, and out of the wall."""


def _slots(rng: np.random.Generator, size: NDArray[np.float64]) -> list[_Slot]:
    """Return slots on the four walls, far enough from one another, in random order."""
    found = []
    for axis, sign in ((0, 1), (0, -1), (1, 1), (1, -1)):
        along = 1 - axis
        for a in np.arange(_SLOT_M, size[along] - _SLOT_M, _SLOT_M):
            for z in np.arange(0.6, size[2] - 0.5, _SLOT_M):
                center = np.empty(3)
                center[axis] = _GAP_M if sign > 0 else size[axis] - _GAP_M
                center[along], center[2] = np.array([a, z]) + rng.uniform(-0.08, 0.08, 2)
                normal = np.zeros(3)
                normal[axis] = sign
                found.append(_Slot(_triple(center), _triple(normal)))
    return [found[i] for i in rng.permutation(len(found))]


def _array_poster(rng: np.random.Generator, code: int, slot: _Slot, printed: Printed) -> Quad:
    side_m = float(rng.uniform(*SIDE_M))
    return _hung(rng, slot, f"array{code}", array_rows(code), side_m, 1.5, printed)[0]


def array_rows(code: int) -> tuple[str, ...]:
    """Return the rows of a poster with one 3-bit array."""
    first, second, third = ("L" if p == "light" else "D" for p in polarities_of(code))
    return f".{first}", second + third


def _hung(
    rng: np.random.Generator,
    slot: _Slot,
    name: str,
    rows: tuple[str, ...],
    side_m: float,
    pitch: float,
    printed: Printed,
) -> list[Quad]:
    """Return a poster of markers in a slot, a little askew, on paper that is not quite white."""
    table = schema.PosterTable(
        name=name,
        rows=rows,
        kinds={"D": printed.dark, "L": printed.light},
        side_m=side_m,
        pitch_m=pitch * side_m,
        level=float(rng.uniform(printed.darkest_paper, 255)),
        center_m=slot.center_m,
        normal=slot.normal,
        turn_deg=float(rng.uniform(-8, 8)),
    )
    return list(poster_copies(table, "poster"))


def _other_poster(
    rng: np.random.Generator, number: int, slot: _Slot, photos: Mapping[str, NDArray[np.uint8]], printed: Printed
) -> Sequence[Quad]:
    """Return a photograph, or foreign markers: one alone, a block without a blank corner, a dense sheet."""
    kind = rng.choice(["photograph", "photograph", "photograph", "single", "block", "dense"])
    if kind == "photograph":
        width = float(rng.uniform(0.15, 0.42))
        photo = photos[str(rng.choice(list(photos)))]
        size = (width, min(0.42, width * photo.shape[0] / photo.shape[1]))
        paper = Paper(photo, size[0])
        pose = quad_pose(slot.normal, (0.0, 0.0, 1.0), slot.center_m, "photograph")
        return [Quad(f"photograph{number:02d}", paper.cover_surface(size, "photograph"), size, pose)]
    side = float(rng.uniform(*SIDE_M))
    columns, rows = {"single": (1, 1), "block": (2, 2), "dense": (5, 7)}[str(kind)]
    side = 0.028 if kind == "dense" else side
    grid = tuple("".join(rng.choice(["D", "L"], columns)) for _ in range(rows))
    return _hung(rng, slot, f"{kind}{number:02d}", grid, side, 1.25 if kind == "dense" else 1.5, printed)


def _furniture(rng: np.random.Generator, size: NDArray[np.float64]) -> list[Mesh]:
    boxes = tuple(
        schema.BoxTable(
            name=f"box{k}",
            size_m=_triple(rng.uniform([0.3, 0.3, 0.4], [0.9, 0.7, 1.8])),
            center_m=(float(rng.uniform(0.6, size[0] - 0.6)), float(rng.uniform(0.6, size[1] - 0.6)), 0.0),
            yaw_deg=float(rng.uniform(0, 90)),
            level=float(rng.uniform(20, 230)),
        )
        for k in range(int(rng.integers(1, 4)))
    )
    return list(build_meshes(boxes, ()))


# --- cameras ------------------------------------------------------------------------------------------------


CAMERAS: Mapping[Split, tuple[Camera, ...]] = {
    "training": (
        Camera(1024, 768, 950.0, 950.0, 511.5, 383.5),
        Camera(1280, 960, 1150.0, 1150.0, 639.5, 479.5),
        Camera(1600, 1200, 1700.0, 1700.0, 799.5, 599.5),
    ),
    "held-out": (
        camera_named("sony-dsc-s85"),
        Camera(2048, 1536, 1774.0, 1774.0, 1020.0, 770.0, distortion=(-0.11, 0.03, 0.001, -0.0005)),
        Camera(1920, 1080, 1380.0, 1385.0, 965.0, 536.0, distortion=(-0.06, 0.01, 0.0, 0.0)),
    ),
}
"""The training cameras have no distortion. The first held-out one is the paper's second camera."""


def random_sensor(rng: np.random.Generator, split: Split) -> Sensor:
    """Return a sensor: training has blur, exposure and read noise; held-out photon noise, defocus and JPEG besides."""
    blur, exposure = float(rng.uniform(0.3, 1.2)), float(rng.uniform(0.5, 1.05))
    if split == "training":
        return Sensor(lens_blur_px=blur, exposure=exposure, read_noise=float(rng.uniform(0, 6)))
    return Sensor(
        lens_blur_px=0.5 * blur,
        defocus_px=float(rng.uniform(0, 1.2)),
        exposure=exposure,
        vignetting=float(rng.uniform(0, 0.4)),
        full_well_e=float(rng.uniform(2000, 20_000)),
        read_noise=float(rng.uniform(0.5, 2.5)),
        gamma=float(rng.uniform(0.8, 1.4)),
        jpeg_quality=int(rng.integers(75, 99)),
    )


def random_view(
    rng: np.random.Generator, room: Room, distance_m: float, tilt_deg: float, tries: int = 200
) -> Pose | None:
    """Return a camera that sees some array from a distance and a tilt, any roll; None if no free position was found."""
    quads = {quad.name: quad for quad in room.scene.quads}
    for _ in range(tries):
        quad = quads[str(rng.choice(room.arrays))]
        middle = np.mean([mark.center_m for mark in quad.marks], axis=0)
        rotation = rotation_about("z", rng.uniform(0, 360)) @ rotation_about("x", tilt_deg)
        away = quad.world_from_quad[:3, :3] @ rotation[:, 2]
        eye = quad.world_from_quad[:3, 3] + quad.world_from_quad[:3, :2] @ middle + distance_m * away
        if _is_free(room, eye):
            return _aimed(rng, eye, -away)
    return None


def _is_free(room: Room, eye: NDArray[np.float64], margin_m: float = 0.15) -> bool:
    """Return whether a point is inside the room and outside the boxes around the furniture."""
    if not ((eye > room.min_m + margin_m) & (eye < room.max_m - margin_m)).all():
        return False
    for mesh in room.scene.meshes:
        corners = mesh.triangles_m.reshape(-1, 3)
        if ((eye > corners.min(axis=0) - margin_m) & (eye < corners.max(axis=0) + margin_m)).all():
            return False
    return True


def _aimed(rng: np.random.Generator, eye: NDArray[np.float64], direction: NDArray[np.float64]) -> Pose:
    """Return a camera that looks along a direction, up to 15° beside it, with any roll."""
    helper = np.array([0.0, 0.0, 1.0]) if abs(direction[2]) < 0.9 else np.array([1.0, 0.0, 0.0])
    right = np.cross(direction, helper)
    right /= np.linalg.norm(right)
    frame = np.stack([right, np.cross(direction, right), direction], axis=1)
    beside = rotation_about("y", rng.uniform(-15, 15)) @ rotation_about("x", rng.uniform(-15, 15))
    return compose(frame @ rotation_about("z", rng.uniform(0, 360)) @ beside, eye)
