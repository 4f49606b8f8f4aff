"""Where kinds of markers are compared: sheets before a photograph, random floors and random rooms.

Of two views with equal seed and number only the kinds differ. Photographs, cameras and noise are those that nothing was
trained on.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from peaksim.camera.camera import resized
from peaksim.camera.frame import Frame, MarkerTruth
from peaksim.camera.sensor import apply_sensor
from peaksim.geometry.pose import look_at, rotation_about
from peaksim.rendering import render
from peaksim.scene import schema
from peaksim.scene.build_quads import quad_pose
from peaksim.scene.paper import Paper, scale_contrast
from peaksim.scene.posters import poster_copies
from peaksim.scene.scene import Light, Quad, Scene

from peakmark.experiments.cave.rooms import (
    CAMERAS,
    Printed,
    array_rows,
    photographs,
    random_room,
    random_sensor,
    random_view,
)
from peakmark.experiments.search.lit_images import plain_image
from peakmark.keypoints.image import as_gray
from peakmark.markers.patterns import Variant

Place = Literal["sheets", "floors", "rooms"]

HALF = 0.5
"""Share of their cameras' width and height that views of floors and rooms have."""

STEEPEST_DEG = 60.0
"""Tilt up to which floors, and arrays on walls, are aimed at."""

_FLOOR_M, _GROUND_M, _STEP_M = 4.5, 9.0, 0.45
"""Width of what lies on a floor, and of the floor, and distance of the sheets."""

_SHARES = {"single": 0.45, "array": 0.2, "photograph": 0.1, "nothing": 0.25}
"""Of what lies on a floor."""


@dataclass(frozen=True)
class View:
    """An image and what it shows."""

    gray: NDArray[np.uint8]
    """(H, W)."""
    truth: tuple[MarkerTruth, ...]
    """Of its markers."""
    frame: Frame | None = None
    scene: Scene | None = None
    """None where there are no arrays."""
    blur_px: float | None = None
    """σ of lens and defocus together, px; None where it is not known."""


def view_of(place: Place, seed: int, number: int, dark: Variant, light: Variant) -> View | None:
    """Return a view of a place with these two markers; None where no position for a camera was found."""
    if place == "sheets":
        image = plain_image(np.random.default_rng((seed, number)), photographs("held-out"), (dark, light))
        return View(image.gray, image.truth)
    streams = [np.random.default_rng((seed, number, part)) for part in range(3)]  # a room takes as many draws as it may
    make = _floor if place == "floors" else _room
    made = make(streams[0], streams[1], Printed(dark.kind, light.kind, 255.0))
    if made is None:
        return None
    frame, scene = made
    sensor = random_sensor(streams[1], "held-out")
    frame = apply_sensor(frame, sensor, streams[2])
    blur_px = float(np.hypot(sensor.lens_blur_px, sensor.defocus_px / 2))  # a disc's deviation is half its radius
    return View(as_gray(frame.image), frame.truth, frame, scene, blur_px)


def _room(rng: np.random.Generator, view: np.random.Generator, printed: Printed) -> tuple[Frame, Scene] | None:
    """Return a view of a random room, of an array from 0.5…3 m."""
    room = random_room(rng, photographs("held-out"), printed)
    cameras = CAMERAS["held-out"]
    camera = resized(cameras[int(view.integers(len(cameras)))], HALF)
    pose = random_view(view, room, view.uniform(0.5, 3), view.uniform(0, STEEPEST_DEG))
    if pose is None:
        return None
    lamp = rng.uniform([0.5, 0.5, 0.6 * room.max_m[2]], room.max_m - [0.5, 0.5, 0.1])
    scene = Scene(room.scene.quads, room.scene.meshes, _lights(rng, lamp))
    return render(scene, camera, pose, renderer="exact"), scene


def _floor(rng: np.random.Generator, view: np.random.Generator, printed: Printed) -> tuple[Frame, Scene]:
    """Return a view of a random floor, from 0.7…1.6 m above it."""
    cameras = CAMERAS["held-out"]
    camera = resized(cameras[int(view.integers(len(cameras)))], HALF)
    height, tilt, heading = (
        view.uniform(0.7, 1.6),
        np.radians(view.uniform(0, STEEPEST_DEG)),
        view.uniform(0, 2 * np.pi),
    )
    target = np.array([*view.uniform(-0.4, 0.4, 2), 0.0])
    ahead = np.array([np.cos(heading), np.sin(heading), 0.0])
    eye = target - height * np.tan(max(float(tilt), 0.01)) * ahead + [0, 0, height]
    pose = look_at(eye, target)
    pose[:3, :3] = pose[:3, :3] @ rotation_about("z", view.uniform(-20, 20))
    lamp = np.array([*rng.uniform(-2.5, 2.5, 2), rng.uniform(1.8, 3.0)])
    scene = Scene((_ground(rng), *_laid(rng, printed)), (), _lights(rng, lamp))
    return render(scene, camera, pose, renderer="exact"), scene


def _lights(rng: np.random.Generator, lamp_m: NDArray[np.float64]) -> tuple[Light, ...]:
    """Return light from everywhere and from a lamp, so that it falls off and furniture throws shadows."""
    everywhere, from_lamp = float(rng.uniform(0.3, 0.7)), float(rng.uniform(0.2, 0.6))
    where = (float(lamp_m[0]), float(lamp_m[1]), float(lamp_m[2]))
    return Light("ambient", everywhere), Light("point", from_lamp, position_m=where, reference_m=1.5)


def _photo(rng: np.random.Generator, width_m: float) -> Paper:
    photos = photographs("held-out")
    photo = photos[str(rng.choice(list(photos)))]
    return Paper(scale_contrast(photo, rng.uniform(0.2, 1.0), rng.uniform(60, 190)), width_m)


def _ground(rng: np.random.Generator) -> Quad:
    size = (_GROUND_M, _GROUND_M)
    texture = _photo(rng, float(rng.uniform(0.8, 2.0))).cover_surface(size, "ground")
    return Quad("ground", texture, size, np.eye(4))


def _laid(rng: np.random.Generator, printed: Printed) -> list[Quad]:
    """Return sheets in any rotation on the floor: single markers, arrays and photographs."""
    quads: list[Quad] = []
    steps = np.arange(-_FLOOR_M / 2, _FLOOR_M / 2, _STEP_M)
    for number, (x, y) in enumerate((x, y) for x in steps for y in steps):
        what = str(rng.choice(list(_SHARES), p=list(_SHARES.values())))
        turn, middle = rng.uniform(0, 2 * np.pi), np.array([x, y]) + rng.uniform(-0.04, 0.04, 2)
        place = (float(middle[0]), float(middle[1]), 0.002)
        up = (float(np.cos(turn)), float(np.sin(turn)), 0.0)
        if what == "photograph":
            paper = _photo(rng, 0.25)
            pose = quad_pose((0.0, 0.0, 1.0), up, place, what)
            quads.append(Quad(f"photo{number}", paper.cover_surface((0.25, 0.2), what), (0.25, 0.2), pose))
        elif what != "nothing":
            quads.append(_sheet(rng, f"{what}{number}", what == "array", place, up, printed))
    return quads


def _sheet(
    rng: np.random.Generator,
    name: str,
    is_array: bool,
    center_m: tuple[float, float, float],
    up: tuple[float, float, float],
    printed: Printed,
) -> Quad:
    """Return one marker with a rim of an eighth of its side or more, or an array."""
    side = float(rng.uniform(0.05, 0.08) if is_array else rng.uniform(0.06, 0.16))
    rows, wide = array_rows(int(rng.integers(8))), 1.25 * side * float(rng.uniform(1, 1.4))
    table = schema.PosterTable(
        name=name,
        rows=rows if is_array else ("D" if rng.random() < 0.5 else "L",),
        kinds={"D": printed.dark, "L": printed.light},
        side_m=side,
        pitch_m=1.5 * side,
        paper_m=(2.5 * side * 1.25,) * 2 if is_array else (wide, wide),
        center_m=center_m,
        normal=(0.0, 0.0, 1.0),
        up=up,
    )
    return next(poster_copies(table, name))
