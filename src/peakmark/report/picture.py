"""Images for notebooks: `overlay(image, found)` shows what was found, wherever PNG is shown."""

from collections.abc import Iterable
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from peaksim.camera.frame import Frame
from PIL import Image

from peakmark.found.found import Found
from peakmark.found.rows import marker_row
from peakmark.identification.detection import Detection
from peakmark.report.overlay import draw_found


@dataclass(frozen=True)
class Picture:
    """An image that notebooks show."""

    pixels: NDArray[np.uint8]
    """(H, W, 3) RGB."""

    def _repr_png_(self) -> bytes:
        """Return the PNG that Jupyter asks for."""
        buffer = BytesIO()
        Image.fromarray(self.pixels).save(buffer, "PNG")
        return buffer.getvalue()

    def show(self) -> None:
        """Open the image in the system's viewer."""
        Image.fromarray(self.pixels).show()

    def save(self, path: str | Path) -> None:
        """Write the image; the ending tells the format."""
        Image.fromarray(self.pixels).save(path)


def overlay(image: ArrayLike | Frame, found: Found | Iterable[Detection] = ()) -> Picture:
    """Return an image, or that of a frame, with the outline of each marker and array.

    Raises
    ------
    InputError
        If the image is none.
    """
    pixels: Any = image.image if isinstance(image, Frame) else np.asarray(image)
    rows = found.rows() if isinstance(found, Found) else tuple(marker_row(marker) for marker in found)
    return Picture(draw_found(pixels, rows))
