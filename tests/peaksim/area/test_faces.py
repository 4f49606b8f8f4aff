"""Tables of faces: what the kernels are told of each print."""

import numpy as np
import pytest
from peaksim import Texture
from peaksim.area.faces import CONTRAST, pack_textures
from peaksim.scene.material import PRINT, Material


@pytest.mark.parametrize("shape", [(3, 4), (3, 4, 3)])
def test_contrast_is_the_deviation_of_the_channel_that_varies_most(shape: tuple[int, ...]) -> None:
    pixels = np.random.default_rng(0).integers(0, 256, shape).astype(np.uint8)
    prints = [(Texture.from_array(pixels), material) for material in (PRINT, Material(reflectance=(0.25, 0.75)))]
    _, (plain, half) = pack_textures(tuple(prints))
    expected = pixels.std(axis=(0, 1)).max()
    assert (plain[CONTRAST], half[CONTRAST]) == pytest.approx((expected, expected / 2))
