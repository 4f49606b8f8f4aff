"""Maximum detector response markers for SIFT and SURF (Schweiger et al. 2009, Section 3), as 8-bit images.

Each marker exists under two limits on its pattern x. "energy", ‖x‖₂ ≤ 1, is the paper's: the leading
eigenvector for SURF, the matched filter (a DoG) for SIFT, then stretched to the whole grey range. Print and
8-bit images limit the "range", |xᵢ| ≤ 1, instead; there the optimum is binary.

**SURF.** With the box filters' outputs Dxx, Dyy, Dxy and any weight w ≥ 0,
``det = Dxx·Dyy − w·Dxy² ≤ Dxx·Dyy = ((Dxx+Dyy)/2)² − ((Dxx−Dyy)/2)² ≤ ((Dxx+Dyy)/2)²``.
The last term is the square of one linear filter, (gxx+gyy)/2, so it is at most ‖(gxx+gyy)/2‖₂² under the
energy limit, met by x ∝ gxx+gyy, and at most ‖(gxx+gyy)/2‖₁² under the range limit, met by x = sign(gxx+gyy)
(free where gxx+gyy = 0). gxx+gyy does not change when x and y are exchanged, so both patterns have Dxx = Dyy,
and it is mirror symmetric, so Dxy = 0: every inequality is an equality and both are globally optimal. ∎

**SIFT.** The response is linear, ``w·x`` with w a DoG: at most ‖w‖₂ for x ∝ w, and ‖w‖₁ for x = sign(w),
which is a disc of the DoG's zero-crossing radius. ∎
"""

from math import erf
from typing import Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import NDArray

from peakmark.errors import InputError, check_choice
from peakmark.markers.optimum import Limit, quadratic_optimum

Polarity = Literal["dark", "light"]

Made = Literal["surf", "sift"]
"""Detectors that markers are made for."""


class Variant(NamedTuple):
    """Which marker."""

    polarity: Polarity
    """Of its centre."""
    limit: Limit = "energy"
    """On its pattern."""
    made_for: Made = "surf"
    """The detector that answers most."""

    @property
    def kind(self) -> str:
        """What scenes, truth and sheets call it, such as "surf-dark" or "sift-range-light"."""
        return "-".join([self.made_for, *(["range"] if self.limit == "range" else []), self.polarity])

    @property
    def is_disc(self) -> bool:
        """Whether it is a disc, whose image is an ellipse in any perspective."""
        return self.made_for == "sift" and self.limit == "range"


IN_PLACE_OF_SURF: dict[Made, dict[str, str]] = {
    "surf": {},
    "sift": {f"surf-{polarity}": f"sift-{polarity}" for polarity in get_args(Polarity)},
}
"""By detector, which kind of marker hangs where a scene has one of SURF's."""

SURF_CELLS = 9
"""Cells along the side of the SURF marker: the boxes of SURF's filters lie on a 9 × 9 grid."""

DOG_RATIO = 2 ** (1 / 3)
"""σ ratio of neighbouring Gaussians in a SIFT of three layers an octave."""

SIFT_SIDE_IN_SIGMA = 12.0
"""Side of the printed SIFT marker in σ: where its DoG has fallen below 1e-4 of the peak."""

DXY_WEIGHT = 0.81
"""OpenCV's weight of Dxy² in the determinant, 0.9²: balances the box filter for Dxy against those for Dxx and Dyy. The
optimum does not depend on it."""

_MAX_SIDE_PX = 16384
"""A quarter of a gigabyte."""


def surf_marker(side_px: int = 147, polarity: Polarity = "dark", limit: Limit = "energy") -> NDArray[np.uint8]:
    """Return the SURF marker as a (side_px, side_px) image.

    The 9 × 9 cells are integrated over each pixel, so any `side_px` ≥ 9 keeps centre, symmetry and mean.
    "energy" has the grey levels 0, 128, 170, 212, 255 (dark), "range" is black and white.

    Raises
    ------
    InputError
        If `side_px` is not an integer in 9…16384, or `polarity` or `limit` is unknown.
    """
    side = _side(side_px)
    share = cell_shares(side, SURF_CELLS)
    return _uint8(share @ surf_cells(polarity, limit).astype(np.float64) @ share.T)


def sift_marker(
    sigma_px: float = 15.0, side_px: int = 181, polarity: Polarity = "dark", limit: Limit = "energy"
) -> NDArray[np.uint8]:
    """Return the SIFT marker as a (side_px, side_px) image: a DoG, or a disc for the "range" limit.

    `sigma_px` is the inner Gaussian's σ; the DoG is G(2^⅓ σ) − G(σ), integrated over each pixel. The DoG
    marker's own scale-space maximum lies at σ/√2, the disc's at σ (an energy limit favours smaller filters).

    Raises
    ------
    InputError
        If `sigma_px` is not in 0.5…side_px / 4, `side_px` not an integer in 9…16384, or a choice is unknown.
    """
    side = _side(side_px)
    if not 0.5 <= sigma_px <= side / 4:
        raise InputError(f"sigma_px: expected 0.5 … side_px / 4 = {side / 4:g}, got {sigma_px}")
    check_pattern(polarity, limit)
    if limit == "energy":
        pattern = _stretched(dog(float(sigma_px), side))
    else:
        pattern = 255.0 * (1.0 - disc_shares(dog_zero_crossing(sigma_px), side))
    return _uint8(pattern if polarity == "dark" else 255.0 - pattern)


def marker_image(side_px: int, variant: Variant) -> NDArray[np.uint8]:
    """Return a marker as a (side_px, side_px) image, a SIFT marker's σ as it is printed."""
    if variant.made_for == "surf":
        return surf_marker(side_px, variant.polarity, variant.limit)
    return sift_marker(side_px / SIFT_SIDE_IN_SIGMA, side_px, variant.polarity, variant.limit)


def surf_cells(polarity: Polarity = "dark", limit: Limit = "energy") -> NDArray[np.uint8]:
    """Return the SURF marker's (9, 9) grey levels, one a cell.

    Under "range" the four 2×2 corners, where gxx + gyy = 0, are free and take the surround's colour.
    """
    check_pattern(polarity, limit)
    pattern = surf_optimum(SURF_CELLS, limit)
    if limit == "range":
        pattern = np.where(pattern < 0, -1.0, 1.0)
    dark = np.rint(np.round(_stretched(pattern), 9)).astype(np.uint8)
    return dark if polarity == "dark" else 255 - dark


def surf_optimum(kernel_side: int = SURF_CELLS, limit: Limit = "energy") -> NDArray[np.float64]:
    """Return the optimal pattern of SURF's determinant at one kernel side, dark centre, zero mean.

    (kernel_side, kernel_side) float64: the unit leading eigenvector (Section 3.2), or sign(gxx + gyy).

    Raises
    ------
    InputError
        If `kernel_side` is no side of SURF's filters, (9 + 6 l)·2^o.
    """
    return quadratic_optimum(surf_filters(kernel_side), surf_form(), limit).x


def surf_form(dxy_weight: float = DXY_WEIGHT) -> NDArray[np.float64]:
    """Return M of ``det = zᵀ M z`` for z = (Dxx, Dyy, Dxy): Section 3.2's ½(G + Gᵀ) in the filters' basis."""
    return np.array([[0.0, 0.5, 0.0], [0.5, 0.0, 0.0], [0.0, 0.0, -dxy_weight]])


def surf_filters(kernel_side: int = SURF_CELLS) -> NDArray[np.float64]:
    """Return SURF's box filters gxx, gyy, gxy as (3, side, side); each box is divided by its area.

    Boxes are given on the 9-grid and scaled as OpenCV does, round-half-even in float32.
    """
    _check_kernel_side(kernel_side)
    edges = np.rint(np.arange(SURF_CELLS + 1, dtype=np.float32) * np.float32(kernel_side / SURF_CELLS)).astype(int)
    gxx = np.zeros((kernel_side, kernel_side))
    gxy = np.zeros_like(gxx)
    for column, weight in zip((0, 3, 6), (1.0, -2.0, 1.0), strict=True):
        _add_box(gxx, edges[[2, 7]], edges[[column, column + 3]], weight)
    for row, column, weight in ((1, 1, 1.0), (1, 5, -1.0), (5, 1, -1.0), (5, 5, 1.0)):
        _add_box(gxy, edges[[row, row + 3]], edges[[column, column + 3]], weight)
    return np.stack([gxx, gxx.T, gxy])


def _add_box(target: NDArray[np.float64], rows: NDArray[np.int_], columns: NDArray[np.int_], weight: float) -> None:
    box = target[slice(*rows), slice(*columns)]
    box += weight / box.size


def cell_shares(side_px: int, cells: int) -> NDArray[np.float64]:
    """Return (side_px, cells): the share of each pixel that each of `cells` equal intervals covers."""
    start = np.arange(side_px)[:, None] * cells / side_px
    cell = np.arange(cells)[None, :]
    overlap = np.minimum(start + cells / side_px, cell + 1) - np.maximum(start, cell)
    return np.asarray(np.maximum(overlap, 0.0) * side_px / cells)


def dog(sigma_px: float, side_px: int) -> NDArray[np.float64]:
    """Return G(2^⅓ σ) − G(σ) integrated over the pixels of a centred (side_px, side_px) square."""
    return _gaussian(DOG_RATIO * sigma_px, side_px) - _gaussian(sigma_px, side_px)


def dog_zero_crossing(sigma_px: float) -> float:
    """Return the radius where G(kσ) = G(σ), k = 2^⅓: σ·√(4 k² ln k / (k² − 1)) ≈ 1.58 σ."""
    k2 = DOG_RATIO**2
    return float(sigma_px * np.sqrt(2 * k2 * np.log(k2) / (k2 - 1)))


def _gaussian(sigma_px: float, side_px: int) -> NDArray[np.float64]:
    edges = np.arange(side_px + 1) - side_px / 2
    line = np.diff([erf(edge) for edge in edges / (np.sqrt(2) * sigma_px)]) / 2
    return np.outer(line, line)


def disc_shares(radius_px: float, side_px: int) -> NDArray[np.float64]:
    """Return (side_px, side_px): the share of each pixel that a centred disc covers, exactly."""
    edges: NDArray[np.float64] = (np.arange(side_px + 1) - side_px / 2) / np.float64(radius_px)
    area = disc_quadrant(edges[None, :], edges[:, None]) * radius_px**2
    return np.diff(np.diff(area, axis=0), axis=1)


def disc_quadrant(x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the area of the unit disc left of x and below y, up to a function of x alone.

    It is ∫ clip(y, −s, s) dt over t in −1…x with s(t) = √(1 − t²); |t| = c is where s = |y|.
    """
    x, y = np.clip(x, -1.0, 1.0), np.clip(y, -1.0, 1.0)
    c = np.sqrt(1 - y**2)
    caps = _half_disc(np.minimum(x, -c)) + np.pi / 4 + _half_disc(np.maximum(x, c)) - _half_disc(c)
    return np.asarray(np.sign(y) * caps + y * (np.clip(x, -c, c) + c))


def _half_disc(t: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the antiderivative of √(1 − t²)."""
    return np.asarray((t * np.sqrt(1 - t**2) + np.arcsin(t)) / 2)


def surf_texture(
    polarity: Polarity = "dark", limit: Limit = "energy", cell_px: int = 16, border_cells: int = 1
) -> NDArray[np.uint8]:
    """Return a SURF marker with whole pixels a cell in a white border: (side, side), side (9 + 2 border) · cell_px."""
    cells = np.pad(surf_cells(polarity, limit), border_cells, constant_values=255)
    return np.kron(cells, np.ones((cell_px, cell_px), dtype=np.uint8))


def plain_ground(polarity: Polarity) -> int:
    """Return the grey level around a SURF marker in references and experiments: white paper around a dark marker.

    A light marker has black around it, as the negative of a dark one; printed, it stands on white, too.
    """
    return 255 if polarity == "dark" else 0


def _stretched(pattern: NDArray[np.float64]) -> NDArray[np.float64]:
    low, high = pattern.min(), pattern.max()
    return np.asarray(255.0 * (pattern - low) / (high - low))


def _uint8(pattern: NDArray[np.float64]) -> NDArray[np.uint8]:
    return np.rint(np.clip(np.round(pattern, 9), 0, 255)).astype(np.uint8)


def _side(side_px: int) -> int:
    if isinstance(side_px, bool) or int(side_px) != side_px or not SURF_CELLS <= side_px <= _MAX_SIDE_PX:
        raise InputError(f"side_px: expected an integer in {SURF_CELLS}…{_MAX_SIDE_PX}, got {side_px!r}")
    return int(side_px)


def check_pattern(polarity: str, limit: str) -> None:
    """Refuse a marker that there is not.

    Raises
    ------
    InputError
        That names the argument, what was expected and what came.
    """
    check_choice(polarity, get_args(Polarity), "polarity")
    check_choice(limit, get_args(Limit), "limit")


def _check_kernel_side(side: int) -> None:
    base = side
    while base > 0 and base % 2 == 0:
        base //= 2
    if base < SURF_CELLS or base % 6 != 3:
        raise InputError(f"kernel_side: expected a side of SURF's filters, (9 + 6 l)·2^o, got {side}")
