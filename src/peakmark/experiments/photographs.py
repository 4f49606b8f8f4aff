"""Photographs that come with scikit-image and scikit-learn, as grey images."""

import numpy as np
from numpy.typing import NDArray

from peakmark.errors import InputError
from peakmark.keypoints.image import as_gray


def load_photograph(name: str) -> NDArray[np.uint8]:
    """Return one of scikit-image's photographs by its function's name, or of scikit-learn's by its file's, (H, W).

    Both are extras: an `InputError` says which to install.
    """
    try:
        from skimage import data
        from sklearn.datasets import load_sample_image
    except ImportError as error:
        raise InputError("photographs need scikit-image and scikit-learn: pip install 'peakmark[train]'") from error
    photo = load_sample_image(name) if name.endswith(".jpg") else getattr(data, name)()
    return as_gray(photo[0] if isinstance(photo, tuple) else photo)
