"""A board of prints on a wall, and where each is in an image."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from peaksim.camera.camera import Camera
from peaksim.geometry.pose import Pose, compose, invert, rotation_about, transform

from peakmark.experiments.comparison.prints import ARRAY_SIDE, DESIGNS, IDS, MARGIN, SIDE_M, Design
from peakmark.markers.array_code import THREE_BIT

CAMERA = Camera(640, 480, 700.0, 700.0, 319.5, 239.5)

PITCH = 1.75
"""Distance of neighbouring prints, in sides: the corners of one's paper never cover another's print."""

MOST_COLUMNS, MOST_ROWS = 8, 6

_EDGE_PX = 3.0
"""A print whose corners come nearer to the image's border does not count."""

CORNERS = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])
"""Of a print's square, in sides right and down from its middle, clockwise from the top left."""


@dataclass(frozen=True)
class Print:
    """One print on a board; the board is the plane z = 0 of the world."""

    design: Design
    code: int
    x_m: float
    y_m: float
    turn_deg: float

    def place(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the (n, 3) world positions of (n, 2) points, in sides right and down from its middle."""
        turn = rotation_about("z", self.turn_deg)[:2, :2]
        flat = (points * [SIDE_M, -SIDE_M]) @ turn.T + [self.x_m, self.y_m]
        return np.pad(flat, ((0, 0), (0, 1)))

    @property
    def pose(self) -> Pose:
        """(4, 4) world from print: x right, y up."""
        return compose(rotation_about("z", self.turn_deg), [self.x_m, self.y_m, 0.0])

    @property
    def corners_m(self) -> NDArray[np.float64]:
        """(4, 3) corners of its square, clockwise from the top left."""
        return self.place(CORNERS)

    @property
    def middles_m(self) -> NDArray[np.float64]:
        """(k, 3) centres of its patterns; the print's centre in an image is the mean of theirs."""
        if self.design != "array":
            return self.place(np.zeros((1, 2)))
        return self.place((np.array(THREE_BIT.cells) - 0.5) * THREE_BIT.pitch * ARRAY_SIDE)


@dataclass(frozen=True)
class TruePrint:
    """A print in an image."""

    design: str
    code: int
    xy: tuple[float, float]
    """Centre, px."""
    side_px: float
    """Square root of its square's area."""
    tilt_deg: float
    is_whole: bool = True
    """Whether it counts: others, cut by the image's border, covered or bent, are neither required nor wrong."""


def random_board(side_px: float, rng: np.random.Generator) -> tuple[Print, ...]:
    """Return prints that fill the image at this side, all designs as often as each other, each id once a design."""
    step = PITCH * side_px
    columns = int(np.clip(np.ceil(CAMERA.width / step), 3, MOST_COLUMNS))
    rows = int(np.clip(np.ceil(CAMERA.height / step), 2, MOST_ROWS))
    order: list[Design] = []
    while len(order) < columns * rows:
        order += [DESIGNS[k] for k in rng.permutation(len(DESIGNS))]
    codes = {design: list(rng.permutation(IDS[design])) for design in DESIGNS}
    prints: list[Print] = []
    for k, design in enumerate(order[: columns * rows]):
        row, column = divmod(k, columns)
        middle = (np.array([column, row]) - (np.array([columns, rows]) - 1) / 2) * PITCH + rng.uniform(-0.05, 0.05, 2)
        number = len([one for one in prints if one.design == design])
        code = int(codes[design][number % IDS[design]])
        x_m, y_m = middle * SIDE_M
        prints.append(Print(design, code, float(x_m), float(y_m), float(rng.uniform(0, 360))))
    return tuple(prints)


def random_pose(side_px: float, tilt_deg: float, rng: np.random.Generator) -> Pose:
    """Return a camera that sees the board's middle in this size and tilt, from any side, with any roll and phase."""
    distance = CAMERA.fx * SIDE_M * np.sqrt(np.cos(np.radians(tilt_deg))) / side_px
    turn = rotation_about("z", rng.uniform(0, 360)) @ rotation_about("x", tilt_deg)
    turn = turn @ rotation_about("z", rng.uniform(0, 360)) @ np.diag([1.0, -1.0, -1.0])
    aside = turn[:, :2] @ rng.uniform(-0.3, 0.3, 2) * side_px * distance / CAMERA.fx
    return compose(turn, -distance * turn[:, 2] + aside)


def seen_prints(board: tuple[Print, ...], pose: Pose, camera: Camera = CAMERA) -> tuple[TruePrint, ...]:
    """Return the prints that are in the image, wholly or in part, and where."""
    seen = [_true(one, pose, camera) for one in board]
    size = [camera.width, camera.height]
    return tuple(
        one
        for one in seen
        if one is not None
        and (np.array(one.xy) > -one.side_px).all()
        and (np.array(one.xy) < np.add(size, one.side_px)).all()
    )


def _true(one: Print, pose: Pose, camera: Camera) -> TruePrint | None:
    """Return a print's truth; None where its plane is not before the camera."""
    outline, corners, middles = (
        camera.project(transform(invert(pose), points))
        for points in (one.place(CORNERS * (1 + MARGIN)), one.corners_m, one.middles_m)
    )
    center = middles.mean(axis=0)
    if not (np.isfinite(outline).all() and np.isfinite(center).all()):
        return None
    x, y = corners.T
    area = abs((x * np.roll(y, -1) - np.roll(x, -1) * y).sum() / 2)
    sight = pose[:3, 3] - [one.x_m, one.y_m, 0.0]
    tilt = float(np.degrees(np.arccos(abs(sight[2]) / np.linalg.norm(sight))))
    inside = np.subtract([camera.width, camera.height], 1 + _EDGE_PX)
    whole = bool((outline > _EDGE_PX).all() and (outline < inside).all())
    return TruePrint(one.design, one.code, (float(center[0]), float(center[1])), float(np.sqrt(area)), tilt, whole)
