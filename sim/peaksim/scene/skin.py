"""What the faces of a mesh show, where that is more than one colour: images and colours of corners."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from peaksim.errors import SceneError
from peaksim.scene.texture import Texture

_SLACK = 1e-4
"""Coordinates this far outside the image are taken for rounding, and moved to its border."""


@dataclass(frozen=True, eq=False)
class Skin:
    """Images and colours on the m faces of a mesh; both sides of a face show the same."""

    textures: tuple[Texture, ...] = ()
    """The images."""
    texture_of_face: NDArray[np.int64] | None = None
    """(m,) which of the images each face shows, −1 for none; None: all show the first one, if there is any."""
    uv: NDArray[np.float64] | None = None
    """(m, 3, 2) where in its image the corners of a face lie, 0…1: u right, v up from the lower left corner. Needed
    where there are textures. `Mesh.from_file` divides faces on which an image is repeated."""
    colors: NDArray[np.float64] | None = None
    """(m, 3, 3) linear grey levels 0…255, RGB, at the corners of faces without an image, linear between them; None:
    such faces have the mesh's colour."""

    @cached_property
    def is_colored(self) -> bool:
        """Whether anything but grey is shown."""
        levels = self.colors
        plain = levels is None or bool((levels == levels[..., :1]).all())
        return not plain or any(texture.channels == 3 for texture in self.textures)

    def textured(self, count: int) -> NDArray[np.int64]:
        """Return the (m,) number of the image of each of m faces, −1 for none."""
        if self.texture_of_face is not None:
            return self.texture_of_face
        return np.full(count, 0 if self.textures else -1)

    def checked(self, count: int, name: str) -> "Skin":
        """Return the skin of `count` faces with arrays of the right types.

        Raises
        ------
        SceneError
            One line that starts with `name`, the mesh, if shapes or ranges do not fit.
        """
        if not all(isinstance(texture, Texture) for texture in self.textures):
            raise SceneError(f"{name}: skin: textures: expected a tuple of Texture, got {self.textures!r:.80}")
        uv = _floats(self.uv, (count, 3, 2), f"{name}: skin: uv")
        if uv is not None and not ((uv >= -_SLACK) & (uv <= 1 + _SLACK)).all():
            raise SceneError(f"{name}: skin: uv: expected numbers in 0…1, got {uv.min():g}…{uv.max():g}")
        colors = _floats(self.colors, (count, 3, 3), f"{name}: skin: colors")
        if colors is not None and not ((colors >= 0) & (colors <= 255)).all():
            raise SceneError(f"{name}: skin: colors: expected grey levels 0…255, got {colors.min():g}…{colors.max():g}")
        numbers = _floats(self.texture_of_face, (count,), f"{name}: skin: texture_of_face")
        most = len(self.textures) - 1
        if numbers is not None and not ((numbers == np.rint(numbers)) & (numbers >= -1) & (numbers <= most)).all():
            raise SceneError(f"{name}: skin: texture_of_face: expected whole numbers in −1…{most}")
        checked = Skin(
            tuple(self.textures),
            None if numbers is None else numbers.astype(np.int64),
            None if uv is None else np.clip(uv, 0, 1),
            colors,
        )
        if uv is None and (checked.textured(count) >= 0).any():
            raise SceneError(f"{name}: skin: uv: expected ({count}, 3, 2) numbers beside textures, got none")
        return checked


def _floats(values: NDArray[Any] | None, shape: tuple[int, ...], name: str) -> NDArray[np.float64] | None:
    if values is None:
        return None
    try:
        numbers = np.array(values, dtype=np.float64)
    except (TypeError, ValueError):
        raise SceneError(f"{name}: expected numbers, got {values!r:.80}") from None
    if numbers.shape != shape or not np.isfinite(numbers).all():
        raise SceneError(f"{name}: expected {shape} finite numbers, got shape {numbers.shape}")
    return numbers
