"""What a print is made of: how its levels become reflectance, and whether it shines."""

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from peaksim.errors import SceneError

WHITE = 255.0
LUMA = np.array([[0.2126], [0.7152], [0.0722]])
"""Grey of RGB, both linear (Rec. 709)."""


@dataclass(frozen=True)
class Material:
    """The surface of a quad or mesh; the default shows every level as it is printed, and does not shine.

    A printed level v (0…255) reflects the share low + (high − low)·curve(v/255) of the light.
    All renderers apply this to the texels, before they interpolate; gloss is drawn by "traced" alone.
    """

    kind: Literal["diffuse", "plastic"] = "diffuse"
    """"plastic" is a diffuse print under a clear rough coat, such as laminate."""
    reflectance: tuple[float, float] = (0.0, 1.0)
    """Shares of the light that levels 0 and 255 reflect, 0…1; ink on paper is near (0.05, 0.85)."""
    curve: Literal["linear", "srgb"] = "linear"
    """How levels become reflectance: in proportion, or decoded as sRGB (IEC 61966-2-1), as a printer does."""
    roughness: float = 0.1
    """Plastic: α of the GGX distribution of the coat's facets, 0…1; 0 is a mirror's smoothness."""
    ior: float = 1.5
    """Plastic: refractive index of the coat, 1…3."""

    def __post_init__(self) -> None:
        low, high = self.reflectance
        for name, value, fits, expected in (
            ("kind", self.kind, self.kind in ("diffuse", "plastic"), '"diffuse" or "plastic"'),
            ("reflectance", self.reflectance, 0 <= low < high <= 1, "two rising numbers in 0…1"),
            ("curve", self.curve, self.curve in ("linear", "srgb"), '"linear" or "srgb"'),
            ("roughness", self.roughness, 0 <= self.roughness <= 1, "a number in 0…1"),
            ("ior", self.ior, 1 < self.ior <= 3, "a number above 1, at most 3"),
        ):
            if not fits:
                raise SceneError(f"material: {name}: expected {expected}, got {value!r}")

    @property
    def keeps_levels(self) -> bool:
        """Whether levels are reflected as they are printed."""
        return self.reflectance == (0.0, 1.0) and self.curve == "linear"

    def levels(self, printed: ArrayLike) -> NDArray[Any]:
        """Return what printed levels (…), 0…255, show in light of multiplier 1: (…) as they are, or float32."""
        values = np.asarray(printed)
        if self.keeps_levels:
            return values
        if values.dtype == np.uint8:
            return np.asarray(self._reflected(np.arange(256))[values])
        return self._reflected(values)

    def _reflected(self, printed: NDArray[Any]) -> NDArray[np.float32]:
        shares = printed / WHITE
        low, high = self.reflectance
        decoded = linear_from_srgb(shares) if self.curve == "srgb" else shares
        return np.asarray(WHITE * (low + (high - low) * decoded), dtype=np.float32)


PRINT = Material()
"""The default: what is printed is what shows."""


def srgb_from_linear(values: ArrayLike) -> NDArray[np.float64]:
    """Return the (…) sRGB values of (…) linear shares, both 0…1 (IEC 61966-2-1)."""
    linear = np.asarray(values, dtype=np.float64)
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * np.maximum(linear, 0.0) ** (1 / 2.4) - 0.055)


def linear_from_srgb(values: ArrayLike) -> NDArray[np.float64]:
    """Return the (…) linear shares of (…) sRGB values, both 0…1 (IEC 61966-2-1)."""
    coded = np.asarray(values, dtype=np.float64)
    return np.where(coded <= 0.04045, coded / 12.92, ((np.maximum(coded, 0.0) + 0.055) / 1.055) ** 2.4)
