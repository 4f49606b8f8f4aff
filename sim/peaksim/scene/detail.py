"""How finely bent paper is divided for an image: as its pixels need, not more."""

from dataclasses import replace
from functools import lru_cache

import numpy as np

from peaksim.camera.shutter import PosedCamera
from peaksim.scene.bend import FINEST
from peaksim.scene.scene import Quad, Scene

_ERROR_PX = 0.006
"""Largest distance of what is drawn from the bent sheet, px; its mean is 0. With half of it "gl" would find more panels
in the last pixel of a pillar than it cuts exactly."""
_STEP, _STEPS = 2.0, 12
"""Errors are FINEST times powers of _STEP, so that the frames of a film share few divisions."""
_LENS = 1.5
"""Lenses enlarge by less than this over their focal length."""


def suited_to(scene: Scene, posed: PosedCamera) -> Scene:
    """Return a scene whose bent sheets have as many panels as an image of it needs."""
    if all(quad.bend is None for quad in scene.quads):
        return scene
    return _divided(scene, tuple(_error(quad, posed) for quad in scene.quads))


@lru_cache(maxsize=4)
def _divided(scene: Scene, errors: tuple[float, ...]) -> Scene:
    quads = tuple(
        quad if quad.bend is None else replace(quad, bend=replace(quad.bend, error=error))
        for quad, error in zip(scene.quads, errors, strict=True)
    )
    return replace(scene, quads=quads)


def _error(quad: Quad, posed: PosedCamera) -> float:
    """Return how far a quad's panels may lie off the sheet, in its length along the arc."""
    if quad.bend is None:
        return FINEST
    half_m = float(np.hypot(*quad.size_m)) / 2
    eyes = posed.row_poses([0.0, posed.camera.height - 1.0])[:, :3, 3]
    distance_m = float(np.linalg.norm(eyes - quad.world_from_quad[:3, 3], axis=1).min()) - half_m
    enlarged = 1.0 if posed.camera.is_pinhole else _LENS
    px_per_m = enlarged * max(posed.camera.fx, posed.camera.fy) / max(distance_m, 1e-3)
    wanted = _ERROR_PX / (px_per_m * quad.size_m[quad.bend.along])
    step = np.floor(np.log(wanted / FINEST) / np.log(_STEP))
    return float(FINEST * _STEP ** np.clip(step, 0, _STEPS))
