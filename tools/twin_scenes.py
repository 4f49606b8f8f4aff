#!/usr/bin/env python3
"""Draw again, with the traced renderer, images that another renderer made of markers on a plane.

    twin_scenes.py FOLDER --out DIR

FOLDER/truth.json lists images with the corners of their markers and tags. Each scene is rebuilt on its plane (same
camera, markers and tags in the same places), lit as its condition says, and taken by four sensors. DIR gets the images,
truth.json of the same form, ours.jpg with one image of each scene, and pairs.html with both side by side. Bent markers
are left out.
"""

import argparse
import html
import json
import os
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from peaksim import Camera, Mesh, Quad, Scene, Texture, Trajectory, render
from peaksim.camera import Sensor, apply_sensor, sensor_named
from peaksim.camera.frame import Frame
from peaksim.camera.thin_lens import ThinLens
from peaksim.geometry.pose import Pose, compose
from peaksim.scene.lamps import AreaLight, Environment
from peaksim.scene.material import Material
from peaksim.scene.scene import Mark
from peaksim.shipped import ASSETS

Row = dict[str, Any]

PHONE = (
    *((0, 0), (5, 38), (10, 54), (20, 78), (30, 98), (40, 115), (60, 142), (80, 166), (100, 186)),
    *((130, 210), (160, 228), (190, 244), (220, 254), (255, 255)),
)
"""Levels of the other images' linear camera and of their phone, medians over the same scenes."""

SENSORS = {
    "linear": sensor_named("machine-vision-linear"),
    "srgb": Sensor(lens_blur_px=0.5, full_well_e=10_000, tone="srgb"),
    "phone": sensor_named("phone", auto_exposure=0.0, exposure=0.5, tone=[[x / 255, y / 255] for x, y in PHONE]),
    "lowlight": sensor_named("webcam-low-light", auto_exposure=0.0, exposure=0.0625),
}
PAPERS = ("gravel", "brick", "grass", "coins")
PAPER = Material(reflectance=(0.05, 0.85), curve="srgb")
LAMINATE = replace(PAPER, kind="plastic", roughness=0.2)
GROUND = Material(reflectance=(0.02, 0.7), curve="srgb")
BORDER = 0.18
"""White around a marker, in sides, as the other images have it."""
SAMPLES = 64
BLUR_PX, MOTION_SIDES, MOTION_DEG = 6.0, 0.25, 107.0
"""Circle of confusion of what is farthest from focus; path of the camera during the exposure, in sides of a marker, and
its direction in the image: as measured in the other images by the kernels that make a sharp image of ours like them."""


@dataclass(frozen=True)
class Plane:
    """A rebuilt scene's plane z = 0, a unit below or before the camera."""

    world_from_camera: Pose
    camera: Camera

    def points(self, xy: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return (n, 3) points of the plane that are seen at (n, 2) px."""
        rays = self.camera.unproject(xy) @ self.world_from_camera[:3, :3].T
        eye = self.world_from_camera[:3, 3]
        return np.asarray(eye - rays * (eye[2] / rays[:, 2:]))


def plane_of(row: Row, camera: Camera) -> Plane:
    """Return the plane whose normal is the mean of those of all flat markers and tags, from their corners."""
    square = np.array([[-1, 1, 0], [1, 1, 0], [1, -1, 0], [-1, -1, 0]]) / 2
    normals = []
    for mark in (*row["markers"], *row["tags"]):
        if not mark.get("bent") and mark["side_px"] > 8:
            corners = np.array(mark["corners"], dtype=np.float64)
            _, rotation, _ = cv2.solvePnP(square, corners, camera.matrix, None, flags=cv2.SOLVEPNP_IPPE_SQUARE)
            normals.append(cv2.Rodrigues(rotation)[0][:, 2])
    z = np.median(normals, axis=0)
    z /= np.linalg.norm(z)
    y = np.array([0.0, 0.0, 1.0]) - z[2] * z  # along the view
    y /= np.linalg.norm(y)
    world_from_camera = np.stack([np.cross(y, z), y, z])
    return Plane(compose(world_from_camera, [0.0, 0.0, 1.0]), camera)


def printed(plane: Plane, corners: Any, name: str, picture: NDArray[np.uint8], kind: str | None, lift: float) -> Quad:
    """Return a square print whose four corners are seen where stated; markers and tags get a white border."""
    points = plane.points(np.array(corners, dtype=np.float64))
    x = points[1] - points[0] + points[2] - points[3]
    side = float(np.linalg.norm(np.roll(points, -1, axis=0) - points, axis=1).mean())
    x /= np.linalg.norm(x)
    pose = compose(
        np.stack([x, np.cross([0.0, 0.0, 1.0], x), [0.0, 0.0, 1.0]], axis=1), np.add(points.mean(axis=0), (0, 0, lift))
    )
    border = round(BORDER * len(picture))
    texture = Texture.from_array(np.pad(picture, border, constant_values=255))
    size = side * texture.pixels.shape[0] / len(picture)
    return Quad(name, texture, (size, size), pose, None if kind is None else Mark(name, kind, side))


def sheets(plane: Plane, row: Row, lift: float) -> Iterator[Quad]:
    """Yield the white papers of a wall's arrays, upright boxes around their markers."""
    groups: dict[str, list[Row]] = {}
    for mark in row["markers"]:
        if mark.get("code") is not None and not mark.get("bent"):
            groups.setdefault(mark["group"], []).append(mark)
    white = Texture.from_array(np.full((1, 1), 255, np.uint8))
    for name, marks in groups.items():
        corners = [plane.points(np.array(mark["corners"], dtype=np.float64)) for mark in marks]
        x = corners[0][1] - corners[0][0]
        side, x = float(np.linalg.norm(x)), x / np.linalg.norm(x)
        y = np.cross([0.0, 0.0, 1.0], x)
        flat = np.concatenate(corners) @ np.stack([x, y], axis=1)
        low, high = flat.min(axis=0) - side, flat.max(axis=0) + side * np.array([1.0, 0.8])
        center = np.array([x, y]).T @ (low + high) / 2 + [0, 0, lift]
        pose = compose(np.stack([x, y, [0.0, 0.0, 1.0]], axis=1), center)
        yield Quad(f"sheet {name}", white, (float(high[0] - low[0]), float(high[1] - low[1])), pose)


def bar(name: str, center: Any, size: tuple[float, float, float]) -> Mesh:
    """Return a dark box, metres."""
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) / 2 * size
    faces = [
        [0, 1, 3],
        [0, 3, 2],
        [4, 6, 7],
        [4, 7, 5],
        [0, 4, 5],
        [0, 5, 1],
        [2, 3, 7],
        [2, 7, 6],
        [0, 2, 6],
        [0, 6, 4],
    ]
    faces += [[1, 5, 7], [1, 7, 3]]
    return Mesh(name, corners, np.array(faces), compose(np.eye(3), center), (30.0,) * 3)


def scene_of(row: Row, plane: Plane, number: int) -> Scene:
    """Return the plane with its prints, lit as the condition says."""
    condition = row["condition"]
    ground = cv2.imread(str(ASSETS / "textures" / f"{PAPERS[number % len(PAPERS)]}.png"), cv2.IMREAD_GRAYSCALE)
    tiled = np.tile(np.block([[ground, ground[:, ::-1]], [ground[::-1], ground[::-1, ::-1]]]), (3, 3))
    quads = [Quad("ground", Texture.from_array(tiled), (9.0, 9.0), compose(np.eye(3), [0, 2, 0]), material=GROUND)]
    quads += sheets(plane, row, 0.0004)
    markers = {
        p: cv2.imread(str(ASSETS / "markers" / f"surf-{p}.png"), cv2.IMREAD_GRAYSCALE) for p in ("dark", "light")
    }
    for k, mark in enumerate(row["markers"]):
        if not mark.get("bent"):
            quads.append(printed(plane, mark["corners"], f"m{k}", markers[mark["polarity"]], mark["polarity"], 0.0008))
    tags = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
    for k, tag in enumerate(row["tags"]):
        picture = cv2.aruco.generateImageMarker(tags, tag["id"], 80, borderBits=1)
        quads.append(printed(plane, tag["corners"], f"t{k}", picture, None, 0.0006))
    paper = LAMINATE if condition == "gloss" else PAPER
    quads = [quads[0], *(replace(quad, material=paper) for quad in quads[1:])]
    looked_at = plane.points(np.array([[319.5, 300.0]]))[0]
    lights: list[Any] = [Environment(radiance=0.08 if condition == "shadow" else 0.25)]
    meshes: tuple[Mesh, ...] = ()
    if condition == "shadow":
        lights.append(AreaLight((looked_at[0] + 1.2, looked_at[1] + 0.4, 2.2), (0.15, 0.15), 500.0))
        meshes = tuple(
            bar(f"bar{k}", np.add(looked_at, (x, 0.1, 1.2)), (0.09, 3.0, 0.02)) for k, x in enumerate((0.15, 0.5, 0.85))
        )
    elif condition == "gloss":  # where the view's mirror image hits a ceiling
        away = looked_at - plane.world_from_camera[:3, 3]
        at = looked_at + away * [1, 1, -1] * (1.8 / -away[2])
        lights.append(AreaLight((float(at[0]), float(at[1]), 1.8), (0.7, 0.7), 20.0))
    else:
        lights.append(AreaLight((looked_at[0] - 0.7, looked_at[1] + 0.5, 2.4), (1.2, 1.2), 4.0))
    return Scene(tuple(quads), meshes, tuple(lights))


def drawn(row: Row, number: int) -> Frame:
    """Return the traced image of a rebuilt scene, before any sensor."""
    camera = Camera(640, 480, float(row["focal_px"]))
    plane = plane_of(row, camera)
    pose = plane.world_from_camera
    if row["condition"] == "dof":
        marks = np.array([m["xy"] for m in row["markers"] if m["side_px"] > 15])
        depths = (plane.points(marks) - pose[:3, 3]) @ pose[:3, 2]
        focus = float(np.median(depths))
        worst = max(abs(z - focus) / (z * focus) for z in depths)
        camera = replace(camera, thin_lens=ThinLens(focus, BLUR_PX / (worst * camera.fx)))
    if row["condition"] == "motion":
        scene = scene_of(row, plane, number)
        side_m = float(np.median([mark.side_m for quad in scene.quads for mark in quad.marks]))
        along = pose[:3, :2] @ [np.cos(np.radians(MOTION_DEG)), np.sin(np.radians(MOTION_DEG))]
        ends = [compose(pose[:3, :3], pose[:3, 3] + half * MOTION_SIDES * side_m * along) for half in (-0.5, 0.5)]
        path = Trajectory(np.array([-0.5, 0.5]), np.stack(ends))
        moving = replace(camera, exposure_s=1.0)
        return render(scene, moving, path, "traced", samples=SAMPLES, seed=number)
    return render(scene_of(row, plane, number), camera, pose, "traced", samples=SAMPLES, seed=number)


def paper_level(linear: NDArray[Any], marks: list[Row]) -> float:
    """Return the level of white paper in an image: the median over markers of their brightest twentieth."""
    levels = []
    for mark in marks:
        (left, top), (right, bottom) = (np.round(edge(np.array(mark["corners"]), axis=0)) for edge in (np.min, np.max))
        if not mark.get("bent") and left >= 0 and top >= 0 and right < linear.shape[1] and bottom < linear.shape[0]:
            levels.append(np.quantile(linear[int(top) : int(bottom) + 1, int(left) : int(right) + 1], 0.95))
    return float(np.median(levels))


def truth_row(row: Row, frame: Frame, version: str, file: str) -> Row:
    """Return a line of truth.json; a marker of which a corner is outside does not lie wholly inside."""
    by_name = {marker.name: marker for marker in frame.truth}
    markers = []
    for k, mark in enumerate(row["markers"]):
        if f"m{k}" in by_name:
            own = by_name[f"m{k}"]
            inside = bool(frame.camera.contains(own.corners_xy).all())
            figures = {"xy": own.center_xy.tolist(), "corners": own.corners_xy.tolist(), "side_px": float(own.side_px)}
            figures |= {
                "tilt_deg": float(own.tilt_deg),
                "visible": float(own.visible_fraction),
                "inside": float(inside),
            }
            markers.append({**mark, **figures})
    return {**row, "file": file, "version": version, "markers": markers, "tags": []}


def main() -> None:
    """Draw all scenes."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--out", type=Path, default=Path("out/twins"))
    args = parser.parse_args()
    rows = [row for row in json.loads((args.folder / "truth.json").read_text()) if row["file"].startswith("traced/")]
    rows = [row for row in rows if row["condition"] != "wrinkle"]
    (args.out / "traced").mkdir(parents=True, exist_ok=True)
    done: list[Row] = []
    for number, name in enumerate(dict.fromkeys(Path(row["file"]).name.split(".")[0] for row in rows)):
        frame = None
        for row in (row for row in rows if Path(row["file"]).name.split(".")[0] == name):
            frame = frame or drawn(row, number)
            version = row["version"]
            # paper is as bright as in the other renderer's linear image
            theirs = cv2.imread(str(args.folder / f"traced/{name}.linear.png"), cv2.IMREAD_GRAYSCALE)
            factor = paper_level(theirs, row["markers"]) / paper_level(frame.linear, row["markers"])
            sensor = replace(SENSORS[version], exposure=SENSORS[version].exposure * factor)
            taken = apply_sensor(frame, sensor, np.random.default_rng((number, list(SENSORS).index(version))))
            file = f"traced/{name}.{version}.png"
            cv2.imwrite(str(args.out / file), taken.image)
            done.append(truth_row(row, frame, version, file))
        print(name, flush=True)
    (args.out / "truth.json").write_text(json.dumps(done))
    small = [
        cv2.resize(cv2.imread(str(args.out / row["file"])), (320, 240), interpolation=cv2.INTER_AREA) for row in done
    ]
    picked = [small[4 * k + k % 4] for k in range(len(small) // 4)]
    while len(picked) % 4:
        picked.append(np.full_like(picked[0], 255))
    sheet = np.vstack([np.hstack(picked[k : k + 4]) for k in range(0, len(picked), 4)])
    cv2.imwrite(str(args.out / "ours.jpg"), sheet, [cv2.IMWRITE_JPEG_QUALITY, 85])
    folder = args.folder.resolve()
    pairs = "\n".join(
        f"<figure><img src='{html.escape(os.path.relpath(folder / row['file'], args.out))}'>"
        f"<img src='{html.escape(row['file'])}'>"
        f"<figcaption>{html.escape(row['condition'] + ', ' + row['version'])}: theirs, ours</figcaption></figure>"
        for row in done
    )
    style = "<style>img{width:49%} figure{margin:0 0 1em} body{font:16px sans-serif}</style>"
    (args.out / "pairs.html").write_text(f"<!doctype html><meta charset=utf-8><title>Twins</title>{style}{pairs}")


if __name__ == "__main__":
    main()
