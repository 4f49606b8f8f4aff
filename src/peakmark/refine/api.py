"""Where exactly an identified marker is: sub-pixel centre and affinity, by aligning the known pattern.

A detector's position follows its octave's step, up to about a pixel off; here the printed pattern itself, seen
through pixel squares, blur and a homography (see `model`), is fitted to the image's grey levels.
"""

from dataclasses import dataclass, replace
from functools import cache
from itertools import product
from typing import get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from peakmark.errors import InputError, check_choice
from peakmark.markers.optimum import Limit
from peakmark.markers.patterns import Made, Polarity, Variant, surf_cells
from peakmark.markers.profile import MOST_RADII, sift_profile
from peakmark.parallel import map_parallel
from peakmark.refine.align import align, shape_grid
from peakmark.refine.model import PARAMETERS, Pattern, predict
from peakmark.refine.round import ROUND_EXTENT, ROUND_SPAN, disc_centers, round_shape_grid, round_template

VARIANTS = {
    one.kind: one for one in (Variant(*each) for each in product(get_args(Polarity), get_args(Limit), get_args(Made)))
}
"""Patterns that `refine` knows, by name."""

PATTERNS = tuple(VARIANTS)

_MIN_EXPLAINED = 0.5
"""Share of the variance that the pattern must explain: below, something else is there."""

_MAX_SHIFT, _SIZE_RATIO = 0.35, 2.0
"""A fit that ends farther off, in sides, or with a size that differs by a larger factor is one of something else."""

_TEMPLATE_BLUR = 0.05**2
"""Variance of the template's blur, sides²."""

_LIMIT_PX = 2000.0
"""Largest size that is accepted, px."""

FLOOR_PX, DITHER = 0.003, 0.5
"""Below this noise in grey levels rounding errs alike along an edge; then this error is added to the covariance."""


@dataclass(frozen=True, eq=False)
class Refined:
    """Refined markers as columns, in the order given."""

    xy: NDArray[np.float64]
    """(n, 2) centre, px; where not converged, the position that was given."""
    affine: NDArray[np.float64]
    """(n, 2, 2) px per side at the centre; the pattern's x and y axes (x right, y down), rotated by the multiple
    of 90° that brings the first nearest to the image's x axis; nan where not converged."""
    perspective: NDArray[np.float64]
    """(n, 2) g of ``x = c + A u / (1 + g·u)``, per side, u = (0, 0) at the pattern's centre and ±½ at its edges."""
    covariance: NDArray[np.float64]
    """(n, 6, 6) of (x, y, a11, a12, a21, a22), px²; nan where not converged. From the residuals themselves; below
    half a grey level of noise, where rounding errs alike along an edge, (0.003 px)² is added. A disc's has what
    `aside` leaves open, too."""
    gain: NDArray[np.float64]
    """(n,) grey levels between the pattern's black and white."""
    offset: NDArray[np.float64]
    """(n,) grey level of its black."""
    blur_px: NDArray[np.float64]
    """(n,) σ of the blur beyond the pixels' own squares."""
    noise: NDArray[np.float64]
    """(n,) root mean square of the residuals, grey levels."""
    explained: NDArray[np.float64]
    """(n,) share of the grey levels' variance that the pattern explains, 0…1."""
    converged: NDArray[np.bool_]
    """(n,) whether a marker was found and its fit converged."""
    aside: NDArray[np.float64]
    """(n, 2) px; where it is not 0 the centre is seen at `xy` + `aside` or at `xy` − `aside`, and nothing tells which:
    of a disc, for its image is an ellipse whatever the tilt. Of a guessed focal length unless one was given."""

    @property
    def side_px(self) -> NDArray[np.float64]:
        """(n,) square root of the affinity's area; nan where not converged."""
        with np.errstate(invalid="ignore"):
            return np.asarray(np.sqrt(np.abs(np.linalg.det(self.affine))))

    def corners(self) -> NDArray[np.float64]:
        """Return (n, 4, 2) the pattern's corners in the image, from its top left clockwise, px."""
        u = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])
        depth = 1 + self.perspective @ u.T
        return np.asarray(self.xy[:, None] + np.einsum("nij,kj->nki", self.affine, u) / depth[:, :, None])


def refine(
    gray: NDArray[np.uint8],
    xy: ArrayLike,
    size: ArrayLike,
    pattern: str = "surf-dark",
    border: float = 0.0,
    focal_px: float | None = None,
) -> Refined:
    """Align a known pattern with the image near each given position.

    Parameters
    ----------
    gray
        (H, W) uint8 image.
    xy
        (n, 2) positions, px, within about a tenth of a side of the centres.
    size
        (n,) or one: square roots of the patterns' areas in the image, px, within about 30 %.
    pattern
        One of `PATTERNS`.
    border
        Width of white around the pattern that may be relied on, in sides; 0 compares the pattern alone, so
        that anything may surround it.
    focal_px
        Focal length, px, which bounds how strong perspective can be, and tells where the centre of a disc may be seen;
        the image's longer side unless given, and then a disc's covariance takes it that this is off by a half.

    Returns
    -------
    Refined
        Where no marker is found near, `converged` is False. No positions give empty columns.

    Raises
    ------
    InputError
        If an argument has the wrong shape or range, or the pattern is unknown.
    """
    gray, positions, sizes = _checked(gray, xy, size)
    model = known_pattern(pattern, border)
    focal = float(max(gray.shape) if focal_px is None else focal_px)
    if not focal > 0:
        raise InputError(f"focal_px: expected a positive number, got {focal_px}")
    span, shapes = (ROUND_SPAN, round_shape_grid()) if model.is_round else (1.0, shape_grid())
    sizes = sizes * span
    extra = (model.lines, model.levels, model.extent, focal, *coarse_template(pattern, border), shapes)
    fits = map_parallel(lambda k: align(gray, positions[k], sizes[k], *extra), range(len(positions)))
    theta = np.array([fit[0] for fit in fits]).reshape(-1, PARAMETERS)
    covariance = np.array([fit[1] for fit in fits]).reshape(-1, PARAMETERS, PARAMETERS)
    noise, converged = (np.array([fit[k] for fit in fits]) for k in (2, 3))
    refined = _refined(theta, covariance, noise, converged.astype(bool), positions, sizes, _variance_of(model))
    refined = _of_whole_sides(refined, span)
    return _at_disc_centers(refined, gray.shape, focal_px) if VARIANTS[pattern].is_disc else refined


def _at_disc_centers(refined: Refined, shape: tuple[int, ...], focal_px: float | None) -> Refined:
    """Return discs between the two places where their centres may be seen, instead of at those of their ellipses."""
    rows = np.flatnonzero(refined.converged)
    places = disc_centers(refined.xy[rows], refined.affine[rows], shape, focal_px)
    xy, aside, covariance = refined.xy.copy(), refined.aside.copy(), refined.covariance.copy()
    xy[rows], aside[rows] = places.xy, places.aside
    covariance[rows, :2, :2] += places.covariance
    return replace(refined, xy=xy, aside=aside, covariance=covariance)


def _variance_of(model: Pattern) -> float:
    """Return the variance of the levels that are compared, nearly."""
    if not model.is_round:
        return float(model.levels.var())
    radius = np.linspace(0, model.extent, 101)
    levels, mean = np.interp(radius, model.lines, model.levels[0]), radius / radius.sum()
    return float((levels**2 * mean).sum() - (levels * mean).sum() ** 2)


def _of_whole_sides(refined: Refined, span: float) -> Refined:
    """Return what was fitted in units that are a share of the side, in sides."""
    scale = np.array([1.0, 1.0, *[1 / span] * 4])
    covariance = refined.covariance * scale[:, None] * scale
    return replace(refined, affine=refined.affine / span, perspective=refined.perspective / span, covariance=covariance)


def _refined(
    theta: NDArray[np.float64],
    covariance: NDArray[np.float64],
    noise: NDArray[np.float64],
    converged: NDArray[np.bool_],
    positions: NDArray[np.float64],
    sizes: NDArray[np.float64],
    level_variance: float,
) -> Refined:
    """Gather fits into columns, and take back those that wandered off or explain too little."""
    affine = theta[:, 2:6].reshape(-1, 2, 2)
    signal = theta[:, 8] ** 2 * level_variance
    explained = signal / np.maximum(signal + noise, 1e-12)
    with np.errstate(invalid="ignore"):  # a fit that diverged is nan, and not kept
        ratio = np.sqrt(np.maximum(np.linalg.det(affine), 0.0)) / sizes
    shift = np.linalg.norm(theta[:, :2] - positions, axis=1) / sizes
    converged = converged & (theta[:, 8] > 0) & (explained > _MIN_EXPLAINED) & (shift < _MAX_SHIFT)
    converged = converged & (ratio < _SIZE_RATIO) & (ratio > 1 / _SIZE_RATIO)
    rotation = upright_rotation(affine)
    keep = converged[:, None]
    linear = np.zeros((len(theta), 6, 6))
    linear[:, :2, :2] = np.eye(2)
    linear[:, 2:4, 2:4] = linear[:, 4:6, 4:6] = rotation.transpose(0, 2, 1)
    spread = linear @ covariance[:, :6, :6] @ linear.transpose(0, 2, 1)
    spread += np.where(noise < DITHER**2, FLOOR_PX**2, 0.0)[:, None, None] * np.eye(6)
    return Refined(
        xy=np.where(keep, theta[:, :2], positions),
        affine=np.where(keep[:, None], affine @ rotation, np.nan),
        perspective=np.where(keep, np.einsum("nji,nj->ni", rotation, theta[:, 6:8]), np.nan),
        covariance=np.where(keep[:, None], spread, np.nan),
        gain=np.where(converged, theta[:, 8], np.nan),
        offset=np.where(converged, theta[:, 9], np.nan),
        blur_px=np.where(converged, np.sqrt(np.abs(theta[:, 10])), np.nan),
        noise=np.sqrt(noise),
        explained=np.where(converged, explained, 0.0),
        converged=converged,
        aside=np.zeros((len(theta), 2)),
    )


def upright_rotation(affine: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return (n, 2, 2) rotations R by multiples of 90° for which A R is rotated by at most 45°."""
    angle = np.arctan2(affine[:, 1, 0] - affine[:, 0, 1], affine[:, 0, 0] + affine[:, 1, 1])
    quarters = -np.rint(angle / (np.pi / 2))
    c, s = np.rint(np.cos(quarters * np.pi / 2)), np.rint(np.sin(quarters * np.pi / 2))
    return np.stack([np.stack([c, -s], axis=-1), np.stack([s, c], axis=-1)], axis=-2)


@cache
def known_pattern(name: str, border: float) -> Pattern:
    """Return a marker by name: SURF's on lines only where levels change, on white, and SIFT's along its radius."""
    check_choice(name, PATTERNS, "pattern")
    variant = VARIANTS[name]
    if not 0 <= border <= (1 if variant.made_for == "surf" else 0):
        expected = "0…1 sides" if variant.made_for == "surf" else "0 with a round pattern"
        raise InputError(f"border: expected {expected}, got {border}")
    if variant.made_for == "sift":
        radii, levels = sift_profile(variant.polarity, variant.limit, MOST_RADII)
        return Pattern(radii / ROUND_SPAN, levels[None], ROUND_EXTENT)
    cells = surf_cells(variant.polarity, variant.limit)
    framed = np.pad(cells / 255.0, 1, constant_values=1.0)
    starts = np.flatnonzero(np.r_[True, (framed[1:] != framed[:-1]).any(axis=1)])
    return Pattern((starts[1:] - 1) / len(cells) - 0.5, framed[np.ix_(starts, starts)], 0.5 + border)


@cache
def coarse_template(name: str, border: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return (m, 2) points over a known pattern and its softened levels there, of mean 0."""
    model = known_pattern(name, border)
    if model.is_round:
        return round_template(model.lines, model.levels[0])
    line = (np.arange(9) - 4) / 9 * 0.95
    samples = np.stack(np.meshgrid(line, line), axis=-1).reshape(-1, 2)
    unit = np.zeros(PARAMETERS)
    unit[[2, 5, 8]], unit[10] = 1.0, _TEMPLATE_BLUR
    levels = predict(unit, samples, model)
    return samples, levels - levels.mean()


def _checked(
    gray: NDArray[np.uint8], xy: ArrayLike, size: ArrayLike
) -> tuple[NDArray[np.uint8], NDArray[np.float64], NDArray[np.float64]]:
    image = np.ascontiguousarray(gray)
    if image.ndim != 2 or image.dtype != np.uint8:
        raise InputError(f"gray: expected (H, W) uint8, got shape {image.shape} of {image.dtype}")
    positions = np.asarray(xy, dtype=np.float64).reshape(-1, 2)
    sizes = np.broadcast_to(np.asarray(size, dtype=np.float64), len(positions))
    if not np.isfinite(positions).all():
        raise InputError("xy: expected finite positions, got nan or inf")
    if not ((sizes >= 2) & (sizes <= _LIMIT_PX)).all():
        raise InputError(f"size: expected 2…{_LIMIT_PX:g} px, got {sizes.min():g}…{sizes.max():g}")
    return image, positions, sizes
