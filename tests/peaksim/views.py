"""Scenes and views that a renderer finds hard, drawn from a seed."""

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from numpy.typing import NDArray
from peaksim import Camera, Quad, Scene, Texture
from peaksim.camera.camera import resized
from peaksim.geometry.pose import compose, look_at, rotation_about
from skimage import data

NAMES = ("gravel", "brick", "camera", "astronaut")


@dataclass(frozen=True)
class View:
    """A scene and the pose of the camera."""

    name: str
    scene: Scene
    camera: Camera
    pose: NDArray[np.float64]


def chequer(cells: int, texels: int) -> NDArray[np.uint8]:
    """Return a black and white chequer of cells² squares, each of texels² texels."""
    index = np.arange(cells * texels) // texels
    return ((index[:, None] + index) % 2 * 255).astype(np.uint8)


def noise(side: int, rng: np.random.Generator) -> NDArray[np.uint8]:
    """Return black and white noise."""
    return (rng.integers(0, 2, (side, side)) * 255).astype(np.uint8)


def marker(texels: int) -> NDArray[np.uint8]:
    """Return a marker-like pattern: squares in five levels within a white border."""
    coarse = np.full((11, 11), 255)
    coarse[1:10, 1:10] = [[0, 128, 170, 212, 255, 212, 170, 128, 0]] * 9
    coarse[4:7, 1:10] = 255 - coarse[4:7, 1:10]
    return np.kron(coarse, np.ones((texels, texels))).astype(np.uint8)


@cache
def photographs() -> list[tuple[str, Texture]]:
    """Return photographs that scikit-image ships."""
    return [(name, Texture.from_array(getattr(data, name)())) for name in NAMES]


def textures(rng: np.random.Generator) -> list[tuple[str, Texture]]:
    """Return named textures of high and of natural contrast."""
    return [
        ("chequer8", Texture.from_array(chequer(64, 8))),
        ("chequer3", Texture.from_array(chequer(101, 3))),
        ("noise", Texture.from_array(noise(512, rng))),
        ("marker", Texture.from_array(marker(12))),
        *photographs(),
    ]


LENSES = {
    "brown4": Camera(distortion=(-0.3, 0.1, 0.001, -0.002)),
    "brown5": Camera(distortion=(-0.28, 0.09, 0.001, -0.002, -0.01)),
    "pincushion": Camera(distortion=(0.15, 0.05, -0.001, 0.001, 0.0)),
    "rational8": Camera(distortion=(0.1, -0.05, 0.001, 0.0005, 0.02, 0.35, -0.02, 0.01)),
    "prism12": Camera(distortion=(-0.2, 0.05, 0.001, -0.002, 0.0, 0.0, 0.0, 0.0, 0.01, -0.004, -0.006, 0.003)),
    "tilted14": Camera(distortion=(*(-0.2, 0.05, 0.001, -0.002, 0.01, 0.1, 0.0, 0.0), *4 * (0.005,), 0.06, -0.09)),
    "fisheye": Camera(fx=330.0, fy=330.0, distortion=(-0.02, 0.004, -0.001, 0.0002), model="fisheye"),
    "wide fisheye": Camera(fx=300.0, fy=300.0, distortion=(0.03, -0.01, 0.002, -0.0003), model="fisheye"),
}
"""Lenses of 640×480 cameras."""


def through(view: View, lens: str) -> View:
    """Return a view through one of LENSES, in as many pixels."""
    camera = resized(LENSES[lens], view.camera.width / LENSES[lens].width)
    return replace(view, name=f"{view.name} {lens}", camera=camera)


def random_view(seed: int, width: int = 256, height: int = 192) -> View:
    """Return view number `seed`: a floor or wall at 40–82° incidence, rolled, with tiles on it."""
    rng = np.random.default_rng(seed)
    name, texture = textures(rng)[seed % 8]
    _, other = textures(rng)[int(rng.integers(0, 7))]
    kind = ("floor", "wall left", "wall right")[seed % 3]
    incidence, roll = rng.uniform(40, 82), rng.uniform(-180, 180) if seed % 2 else 0.0
    # texels a pixel along the uncompressed axis, at the middle of the view
    density = float(np.exp(rng.uniform(np.log(0.1), np.log(4))))
    camera = Camera(width, height, 0.87 * width, 0.87 * width, (width - 1) / 2, (height - 1) / 2)
    distance = 2.0
    side = texture.size[0] * distance / camera.fx / density
    azimuth = rng.uniform(0, 360) if seed % 4 else 0.0
    plane = {"floor": np.eye(3), "wall left": rotation_about("y", 90), "wall right": rotation_about("y", -90)}[kind]
    normal, along = plane[:, 2], {"floor": np.array([0.0, 1, 0])}.get(kind, np.array([0.0, 1, 0]))
    eye = distance * (np.cos(np.radians(incidence)) * normal - np.sin(np.radians(incidence)) * along)
    pose = look_at(eye, np.zeros(3), up=normal if kind == "floor" else (0, 0, 1))
    pose = pose @ compose(rotation_about("z", roll), np.zeros(3))
    rotated = plane @ rotation_about("z", azimuth)
    quads = [Quad("plane", texture, (side, side), compose(rotated, np.zeros(3)))]
    for k in range(6):
        position = plane @ np.array([*rng.uniform(-0.8, 0.8, 2), 0.002 + 0.02 * k])
        tilt = rotation_about("xy"[k % 2], rng.uniform(-60, 60) if k > 2 else 0.0)
        tile = compose(plane @ rotation_about("z", rng.uniform(0, 360)) @ tilt, position)
        quads.append(Quad(f"tile{k}", other, (0.25, 0.25), tile))
    label = f"{seed} {kind} {name} {incidence:.0f}° roll {roll:.0f}° {density:.2f} texel/px"
    return View(label, Scene(tuple(quads)), camera, pose)
