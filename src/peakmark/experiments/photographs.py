"""Photographs that come with scikit-image and scikit-learn, as grey images."""

from importlib.util import find_spec
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from peaksim.image_file import read_image

from peakmark.errors import InputError
from peakmark.keypoints.image import as_gray


def load_photograph(name: str) -> NDArray[np.uint8]:
    """Return one of scikit-image's photographs by its function's name, or of scikit-learn's by its file's, (H, W).

    Both are extras: an `InputError` says which to install.
    """
    learn = find_spec("sklearn")
    if learn is None or learn.origin is None or find_spec("skimage") is None:
        raise InputError("photographs need scikit-image and scikit-learn: pip install 'peakmark[train]'")
    if name.endswith(".jpg"):  # importing the library to read its file takes a second
        return as_gray(read_image(Path(learn.origin).parent / "datasets" / "images" / name))
    from skimage import data

    photo = getattr(data, name)()
    return as_gray(photo[0] if isinstance(photo, tuple) else photo)
