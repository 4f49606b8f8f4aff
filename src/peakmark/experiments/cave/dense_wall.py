"""Walls of posters dense with markers: how many feature points they give, and how many of them come back.

`compare_walls` writes report.html and result.json.
"""

from collections.abc import Sequence
from dataclasses import astuple, dataclass, replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import scipy
from numpy.typing import NDArray
from peaksim.camera.camera import Camera
from peaksim.camera.sensor import apply_sensor
from peaksim.geometry.pose import Pose, invert, look_at, transform
from peaksim.rendering import render
from peaksim.scene.file import Setup, load_scene
from peaksim.scene.scene import Scene

from peakmark import surf
from peakmark.errors import InputError
from peakmark.experiments.option import check_range
from peakmark.keypoints.image import as_gray
from peakmark.keypoints.keypoints import Keypoints
from peakmark.report.page import Section, Table, write_report
from peakmark.report.results import result_folder, write_json
from peakmark.score.wanted import TOLERANCE_PX

WALLS = ("dark", "light", "mixed")
"""Names of the dense posters in `scenes/cave.toml`."""

DISTANCE_M = 1.5
"""Of the cameras from the wall."""

APART_DEG = 30.0
"""Angle between the two views, half to each side of the wall's normal."""

SCALE_RATIO = 1.5
"""A feature repeats if one whose scale is within this factor lies within `TOLERANCE_PX` of where its point on the wall
is seen. Chosen by hand: the sizes of neighbouring layers of SURF's first octave are 15 and 21 px, 1.4 times apart."""


@dataclass(frozen=True)
class Patch:
    """The part of a wall that dense posters cover."""

    corners_m: NDArray[np.float64]
    """(4, 3) its outline."""
    normal: NDArray[np.float64]
    """(3,) out of the wall."""


@dataclass(frozen=True)
class WallFeatures:
    """The feature points of a wall."""

    wall: str
    """Name of its posters."""
    posters: bool
    """Whether they hang there."""
    features: int
    features_per_megapixel: float
    """In the first view of the patch, in all and per 10⁶ pixels of it."""
    in_both_views: int
    """Those whose point on the wall lies in the second view, too."""
    repeated: int
    """Those that were found there again."""
    repeatability: float | None
    """Share of them; None without any."""


def compare_walls(scene: str, threshold: float, seed: int, out: Path) -> tuple[str, Table]:
    """Measure every wall with and without its posters, write the results, and return the table with its title."""
    check_range("seed", seed, 0)
    setup = load_scene(scene)
    rows = [count_features(setup, name, has, threshold, seed) for name in WALLS for has in (True, False)]
    head = ("wall", "posters", "features", "features/MP", "in both views", "found again", "share")
    table = Table(head, [(row.wall, "yes" if row.posters else "no", *astuple(row)[2:]) for row in rows])
    lead = f"SURF, threshold {threshold:g}; two views {APART_DEG:g}° apart, {DISTANCE_M:g} m away, seed {seed}."
    with result_folder(out) as folder:
        write_report(folder / "report.html", "Feature points of dense walls", lead, [Section("Walls", table=table)])
        write_json(folder / "result.json", {"threshold": threshold, "seed": seed, "rows": rows})
    return lead, table


def patch_of(scene: Scene, name: str) -> Patch:
    """Return the box around the copies of a poster; none of that name is an `InputError`."""
    quads = [quad for quad in scene.quads if quad.name.startswith(name) and quad.marks]
    if not quads:
        raise InputError(f"--scene: expected posters called {name}01 and so on, found none")
    frame = quads[0].world_from_quad
    flat = transform(invert(frame), np.concatenate([quad.corners_m for quad in quads]))
    (x0, y0, _), (x1, y1, _) = flat.min(axis=0), flat.max(axis=0)
    corners = np.array([[x0, y1, 0], [x1, y1, 0], [x1, y0, 0], [x0, y0, 0]])
    return Patch(transform(frame, corners), frame[:3, 2])


def two_views(patch: Patch) -> tuple[Pose, Pose]:
    """Return cameras `DISTANCE_M` from the middle of a patch, `APART_DEG` apart."""
    middle, half = patch.corners_m.mean(axis=0), np.radians(APART_DEG / 2)
    aside = np.cross([0.0, 0.0, 1.0], patch.normal)
    left, right = (
        look_at(middle + DISTANCE_M * (np.cos(half) * patch.normal + sign * np.sin(half) * aside), middle)
        for sign in (-1, 1)
    )
    return left, right


def count_features(setup: Setup, name: str, has_posters: bool, threshold: float, seed: int) -> WallFeatures:
    """Return the features of a wall's patch, and how many repeat, with or without its posters."""
    patch = patch_of(setup.scene, name)
    kept = tuple(quad for quad in setup.scene.quads if has_posters or not quad.marks)
    scene, camera = replace(setup.scene, quads=kept), setup.camera
    poses = two_views(patch)
    found = []
    for index, pose in enumerate(poses):
        frame = render(scene, camera, pose, renderer="exact")
        frame = apply_sensor(frame, setup.sensor, np.random.default_rng((seed, index)))
        features = surf.detect(as_gray(frame.image), threshold=threshold)
        found.append(features[_is_inside(camera, pose, patch, features.xy)])
    megapixels = _area_px(camera, poses[0], patch) / 1e6
    common, repeated = repeats(camera, poses, patch, found)
    return WallFeatures(
        wall=name,
        posters=has_posters,
        features=len(found[0]),
        features_per_megapixel=len(found[0]) / megapixels,
        in_both_views=common,
        repeated=repeated,
        repeatability=repeated / common if common else None,
    )


def repeats(camera: Camera, poses: tuple[Pose, Pose], patch: Patch, found: Sequence[Keypoints]) -> tuple[int, int]:
    """Return how many features of the first view lie in the second image, and how many were found there again."""
    first, second = found
    points = on_plane(camera, poses[0], patch, first.xy)
    xy = camera.project(transform(invert(poses[1]), points))
    inside = ((xy >= 0) & (xy <= [camera.width - 1, camera.height - 1])).all(axis=1)
    if len(second) == 0:
        return int(inside.sum()), 0
    tree = scipy.spatial.cKDTree(second.xy)
    again = sum(
        bool(np.any(np.abs(np.log(second.scale[near] / scale)) <= np.log(SCALE_RATIO)))
        for near, scale in zip(tree.query_ball_point(xy[inside], TOLERANCE_PX), first.scale[inside], strict=True)
        if near
    )
    return int(inside.sum()), again


def on_plane(camera: Camera, pose: Pose, patch: Patch, xy: NDArray[np.floating[Any]]) -> NDArray[np.float64]:
    """Return the (n, 3) points of the patch's plane that are seen at (n, 2) px."""
    rays = camera.unproject(xy) @ pose[:3, :3].T
    reach = ((patch.corners_m[0] - pose[:3, 3]) @ patch.normal) / (rays @ patch.normal)
    return np.asarray(pose[:3, 3] + reach[:, None] * rays)


def _is_inside(camera: Camera, pose: Pose, patch: Patch, xy: NDArray[np.float32]) -> NDArray[np.bool_]:
    """Return (n,) whether the points on the wall lie in the patch."""
    origin, right, down = patch.corners_m[0], patch.corners_m[1], patch.corners_m[3]
    local = on_plane(camera, pose, patch, xy) - origin
    shares = np.stack([local @ (end - origin) / ((end - origin) @ (end - origin)) for end in (right, down)])
    return np.asarray(((shares >= 0) & (shares <= 1)).all(axis=0))


def _area_px(camera: Camera, pose: Pose, patch: Patch) -> float:
    """Return the area of the patch in the image; parts outside the image do not count."""
    xy = camera.project(transform(invert(pose), patch.corners_m)).astype(np.float32)
    frame = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32) * [camera.width, camera.height] - np.float32(0.5)
    area, _ = cv2.intersectConvexConvex(xy, frame.astype(np.float32))
    return float(area)
