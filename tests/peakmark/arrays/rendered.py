"""Arrays on paper before a grey wall, rendered exactly, with the detections that truth makes of them."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from peaksim.camera.camera import Camera
from peaksim.geometry.pose import Pose
from peaksim.rendering import render
from peaksim.scene.scene import Quad, Scene
from peaksim.scene.texture import Texture
from scipy.linalg import sqrtm

from peakmark.arrays.look import OF_SURF, Print
from peakmark.identification.detection import Detection
from peakmark.markers.array_code import THREE_BIT, Layout, polarities_of
from peakmark.markers.patterns import Variant, marker_image
from tests.peakmark.arrays.arrays_scene import SIDE_M, detections, printed_array

VIEW = Camera(width=360, height=270, fx=400.0, fy=400.0, cx=179.5, cy=134.5)
TEXELS = 72
_MARGIN = 0.75


def paper(code: int, layout: Layout = THREE_BIT, printed: Print = OF_SURF) -> NDArray[np.uint8]:
    """Return an array on white paper, 72 texels a side, with a margin of ¾ of a side."""
    columns, rows = (1 + layout.pitch * (n - 1) + 2 * _MARGIN for n in (layout.columns, layout.rows))
    sheet = np.full((round(rows * TEXELS), round(columns * TEXELS)), 255, np.uint8)
    for (column, row), polarity in zip(layout.cells, polarities_of(code, layout), strict=True):
        left, top = (round((_MARGIN + layout.pitch * k) * TEXELS) for k in (column, row))
        sheet[top : top + TEXELS, left : left + TEXELS] = marker_image(
            TEXELS, Variant(polarity, printed.limit, printed.made_for)
        )
    return sheet


def view(sheet: NDArray[np.uint8], world_from_camera: Pose) -> NDArray[np.uint8]:
    """Return the image of a sheet whose middle is the world's origin."""
    size = (sheet.shape[1] / TEXELS * SIDE_M, sheet.shape[0] / TEXELS * SIDE_M)
    quad = Quad("sheet", Texture.from_array(sheet), size, np.eye(4))
    return np.asarray(render(Scene((quad,)), VIEW, world_from_camera, renderer="exact").image)


def true_detections(
    code: int, world_from_camera: Pose, layout: Layout = THREE_BIT, printed: Print = OF_SURF
) -> list[Detection]:
    """Return what a perfect search finds, in reading order; those of round markers show no rotation."""
    found, shapes = detections(printed_array(code, layout=layout), world_from_camera, camera=VIEW)
    if printed.made_for == "sift":
        shapes = [np.real(sqrtm(shape @ shape.T)) for shape in shapes]
    kind = {"made_for": printed.made_for, "limit": printed.limit}
    return [replace(d, affinity=shape, **kind) for d, shape in zip(found, shapes, strict=True)]  # type: ignore[arg-type]
