"""Views of every kind that the exact renderer draws, whose levels `tests/golden/native/area.npz` keeps.

The file was made by the kernels that Numba compiled, before they were ported to C. `python -m
tests.peaksim.area.golden_views` writes it anew, which would lose that origin.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from peaksim import Light, Quad, Scene, load_scene
from peaksim.area.faces import channels_of
from peaksim.area.integrate import integrate
from peaksim.area.light_map import LightMaps
from peaksim.camera.camera import resized
from peaksim.camera.shutter import PosedCamera
from peaksim.geometry.pose import compose, look_at, rotation_about
from peaksim.geometry.trajectory import Trajectory
from peaksim.rendering import draw_levels

from tests.peaksim.area.test_light import CAMERA, LIGHTS, furniture
from tests.peaksim.views import random_view, textures, through
from tests.places import ROOT

GOLDEN = ROOT / "tests" / "golden" / "native"
Levels = NDArray[np.float32]
_ROLLING_ROW_S = 4e-4
_ABOVE = look_at([1.5, -2.0, 1.4], [0, 0, 0.2])


def shipped(name: str, time_s: float, width: int, **changes: float) -> tuple[Scene, PosedCamera]:
    """Return a shipped scene, and its camera with `width` columns at a time of its trajectory."""
    scene, camera, trajectory = load_scene(name)
    return scene, PosedCamera(replace(resized(camera, width / camera.width), **changes), trajectory, time_s)


def sharp(name: str, time_s: float, width: int, **changes: float) -> Levels:
    """Return the levels of a shipped scene."""
    scene, posed = shipped(name, time_s, width, **changes)
    return integrate(scene, posed.camera, posed.row_poses(np.arange(posed.camera.height)))


def blurred(name: str, time_s: float, width: int) -> Levels:
    """Return the levels of a shipped scene from a camera that moves while it exposes."""
    scene, posed = shipped(name, time_s, width, exposure_s=0.02)
    return draw_levels(scene, posed, "exact")[0]


def of_view(seed: int, lens: str | None = None) -> Levels:
    """Return the levels of a random view, through a lens if one is named."""
    view = random_view(seed, 96, 72)
    view = through(view, lens) if lens else view
    return integrate(view.scene, view.camera, view.pose[None])


def lit(name: str, maps: LightMaps | None = None) -> Levels:
    """Return the levels of boxes on a floor in some light."""
    scene = replace(furniture(len(name)), lights=LIGHTS.get(name, ()), background=30.0)
    return integrate(scene, CAMERA, _ABOVE[None], maps)


def baked(name: str, channels: int) -> Levels:
    """Return the levels of boxes on a printed floor in baked light of any values, beside plain light if it is named."""
    scene = furniture(4)
    texture = dict(textures(np.random.default_rng(2)))["astronaut" if channels == 3 else "camera"]
    quads = (Quad("floor", texture, (4.0, 4.0), scene.quads[0].world_from_quad), *scene.quads[1:])
    scene = replace(scene, quads=quads, lights=LIGHTS.get(name, ()))
    return integrate(scene, CAMERA, _ABOVE[None], any_maps(scene))


def any_maps(scene: Scene) -> LightMaps:
    """Return light maps of any sizes and values for a scene."""
    rng = np.random.default_rng(7)
    shapes = rng.integers(1, 30, (len(scene.quads) + sum(len(m.faces) for m in scene.meshes), 2, 2))
    texels = rng.uniform(0, 1.5, (int(shapes.prod(axis=2).sum()), channels_of(scene))).astype(np.float32)
    return LightMaps(shapes, texels, texel_m=0.1, noise=0.0, detail=0.0)


def rolling_lit() -> Levels:
    """Return the levels of boxes in two lights through a rolling shutter."""
    turned = _ABOVE @ compose(rotation_about("z", 3), [0.05, 0.02, 0.1])
    camera = replace(CAMERA, row_time_s=_ROLLING_ROW_S)
    posed = PosedCamera(camera, Trajectory(np.array([0.0, 0.02]), np.stack([_ABOVE, turned])), 0.01)
    scene = replace(furniture(3), lights=(*LIGHTS["two"], Light("ambient", 0.1)))
    return integrate(scene, camera, posed.row_poses(np.arange(camera.height)))


LENSES = {"brown5": 5, "wide fisheye": 4, "tilted14": 7}
"""Lens → number of the view through it."""
VIEWS: dict[str, Callable[[], Levels]] = {
    **{f"random {seed}": lambda seed=seed: of_view(seed) for seed in (2, 5, 7, 9, 12, 17)},
    **{lens: lambda seed=seed, lens=lens: of_view(seed, lens) for lens, seed in LENSES.items()},
    "hall": lambda: sharp("hall", 3.0, 160),
    "hall far": lambda: sharp("hall", 14.0, 96),
    "floor": lambda: sharp("floor", 1.0, 128),
    "cave": lambda: sharp("cave", 5.0, 128),
    "cave rolling": lambda: sharp("cave", 2.0, 96, row_time_s=_ROLLING_ROW_S),
    "hall rolling": lambda: sharp("hall", 8.0, 96, row_time_s=_ROLLING_ROW_S),
    "hall blurred": lambda: blurred("hall", 10.0, 64),
    **{name: lambda name=name: lit(name) for name in LIGHTS},
    "rolling in light": rolling_lit,
    "baked": lambda: baked("", 1),
    "baked colour": lambda: baked("", 3),
    "baked and point": lambda: baked("point", 1),
}


def main() -> None:
    """Write the levels of all views."""
    GOLDEN.mkdir(parents=True, exist_ok=True)
    np.savez_compressed(GOLDEN / "area.npz", **{name: draw() for name, draw in VIEWS.items()})


if __name__ == "__main__":
    main()
