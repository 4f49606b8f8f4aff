"""Photographs that come with scikit-image and scikit-learn, as grey images."""

from importlib.util import find_spec
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from peaksim.extras import needs_extra
from peaksim.image_file import read_image

from peakmark.keypoints.image import as_gray


@needs_extra
def load_photograph(name: str) -> NDArray[np.uint8]:
    """Return one of scikit-image's photographs by its function's name, or of scikit-learn's by its file's, (H, W).

    Both libraries are extras: a `ModuleNotFoundError` says which to install.
    """
    if name.endswith(".jpg"):  # importing the library to read its file takes a second
        library = find_spec("sklearn")
        if library is None or library.origin is None:
            raise ModuleNotFoundError("No module named 'sklearn'", name="sklearn")
        return as_gray(read_image(Path(library.origin).parent / "datasets" / "images" / name))
    from skimage import data

    photo = getattr(data, name)()
    return as_gray(photo[0] if isinstance(photo, tuple) else photo)
