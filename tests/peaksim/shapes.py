"""Plain quads and boxes for hand-made scenes."""

import numpy as np
from peaksim import Quad, Texture

BOX_M = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * 0.5
"""(8, 3) corners of a cube of side 1 m around the origin."""
BOX_FACES = np.array(
    [
        [int(corner) for corner in f]
        for f in ["013", "032", "467", "475", "045", "051", "237", "276", "026", "064", "157", "173"]
    ]
)
"""(12, 3) its triangles, counter-clockwise from outside."""


def plain_texture(level: int) -> Texture:
    return Texture.from_array(np.full((1, 1), level, np.uint8))


def plain_quad(name: str, level: int, side_m: float, pose: np.ndarray) -> Quad:
    return Quad(name, plain_texture(level), (side_m, side_m), pose)
