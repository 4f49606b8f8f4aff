"""The multiplier of linear grey levels over pixels and pieces of pixels, with shadows from meshes.

What is baked is the mean of a map over the piece. Any other multiplier is computed at the piece's middle; where a mesh
comes near the ray from there to the light, samples of the piece tell which share is lit.
"""

import numpy as np
from numpy.typing import NDArray

from peaksim.native import function
from peaksim.scene.scene import Light

_KINDS = {"ambient": 0, "directional": 1, "point": 2}


def pack_lights(lights: tuple[Light, ...]) -> NDArray[np.float64]:
    """Return an (l, 7) table of lights: kind, intensity, vector, reference distance, and whether it casts shadows.

    The vector is the unit direction towards a directional light, or a position.
    """
    return np.array([_row(light) for light in lights], dtype=np.float64).reshape(-1, 7)


def _row(light: Light) -> list[float]:
    vector = np.asarray(light.position_m, dtype=np.float64)
    if light.kind == "directional":
        vector = -np.asarray(light.direction, dtype=np.float64) / np.linalg.norm(light.direction)
    return [_KINDS[light.kind], light.intensity, *vector, light.reference_m, light.casts_shadows]


light_pieces = function(
    "void light_pieces(const f8[faces,3,3] planes, const f8[faces,28] table, const f8[poses,3] eyes, "
    "const f8[n_lights,7] lights, const f8[nodes,6] boxes, const i8[nodes,2] links, const f8[n_solids,10] solids, "
    "const i8[mapped,2,3] maps, const f4[n_texels,channels] texels, i8 count, const f8[n,24,2] polygons, "
    "const i8[n,4] pieces, f8[lit,channels] light)"
)
"""Write the light on the first `count` pieces of a band.

planes, table
    As in `Faces`.
eyes
    Camera centres, world, of one pose, or one for each row.
lights
    From `pack_lights`.
boxes, links, solids
    As in `Solids`: what casts shadows.
maps, texels
    As in `PackedMaps`.
polygons, pieces
    As in `cut.Lists`.
light
    Written: multipliers.
"""
light_owned = function(
    "void light_owned(const f8[rows,columns,3] rays, const f8[poses,faces,5,3] sides, const f8[faces,3,3] planes, "
    "const f8[faces,28] table, const f8[poses,3] eyes, const f8[n_lights,7] lights, const f8[nodes,6] boxes, "
    "const i8[nodes,2] links, const f8[n_solids,10] solids, const i8[height,width] owners, "
    "f8[height,width,channels] light)"
)
"""Write the plain light on all pixels of a band that have an owner to `light`; see `light_pieces`."""
