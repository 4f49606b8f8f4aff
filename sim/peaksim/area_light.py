"""Lights: the multiplier of linear grey levels at a point, with shadows from meshes."""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from peaksim.errors import SceneError
from peaksim.rays import blocked
from peaksim.scene import Light

AMBIENT, DIRECTIONAL, POINT = 0, 1, 2
_KINDS = {"ambient": AMBIENT, "directional": DIRECTIONAL, "point": POINT}
_OFFSET_M = 1e-5


class Lights(NamedTuple):
    """The lights of a scene as arrays."""

    kinds: NDArray[np.int64]
    """(l,) AMBIENT, DIRECTIONAL or POINT."""
    intensities: NDArray[np.float64]
    """(l,) multipliers."""
    vectors: NDArray[np.float64]
    """(l, 3) unit direction towards a directional light, position of a point light; world."""
    references_m: NDArray[np.float64]
    """(l,) distance at which a point light's multiplier is its intensity."""
    shadows: NDArray[np.bool_]
    """(l,) whether meshes throw shadows."""


def pack_lights(lights: tuple[Light, ...]) -> Lights:
    """Return the lights as arrays.

    Raises
    ------
    SceneError
        If a directional light has no direction.
    """
    vectors = np.zeros((len(lights), 3))
    for k, light in enumerate(lights):
        vectors[k] = light.position_m if light.kind == "point" else -np.asarray(light.direction, dtype=np.float64)
        length = float(np.linalg.norm(vectors[k]))
        if light.kind == "directional":
            if not length > 0:
                raise SceneError(f"light {k}: direction: expected a direction, got {light.direction}")
            vectors[k] /= length
    return Lights(
        np.array([_KINDS[light.kind] for light in lights], dtype=np.int64),
        np.array([light.intensity for light in lights], dtype=np.float64),
        vectors,
        np.array([light.reference_m for light in lights], dtype=np.float64),
        np.array([light.casts_shadows for light in lights], dtype=np.bool_),
    )


@njit(cache=True, nogil=True, error_model="numpy")
def light_at(lights, solids, place, normal, eye):  # type: ignore[no-untyped-def]
    """Return the multiplier at `place` (world) on a surface with `normal`, as seen from `eye`; 1 without lights."""
    if lights.kinds.size == 0:
        return 1.0
    side = 0.0
    for k in range(3):
        side += normal[k] * (eye[k] - place[k])
    facing = 1.0 if side >= 0.0 else -1.0
    total = 0.0
    ray, start = np.empty(3), np.empty(3)
    for light in range(lights.kinds.size):
        if lights.kinds[light] == AMBIENT:
            total += lights.intensities[light]
            continue
        farthest = np.inf
        length = 1.0
        for k in range(3):
            ray[k] = lights.vectors[light, k]
            if lights.kinds[light] == POINT:
                ray[k] -= place[k]
        if lights.kinds[light] == POINT:
            length = np.sqrt(ray[0] ** 2 + ray[1] ** 2 + ray[2] ** 2)
            farthest = 1.0
        cosine = facing * (ray[0] * normal[0] + ray[1] * normal[1] + ray[2] * normal[2])
        if cosine <= 0.0:
            continue
        strength = lights.intensities[light] * cosine
        if lights.kinds[light] == POINT:
            strength *= lights.references_m[light] ** 2 / length**3
        if lights.shadows[light]:
            for k in range(3):
                start[k] = place[k] + facing * normal[k] * _OFFSET_M
            if blocked(solids, start, ray, 0.0, farthest):
                continue
        total += strength
    return total
