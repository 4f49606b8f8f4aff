"""What an alignment in any light says for a marker and against it, as columns.

A blob can be explained by the pattern once enough blur is allowed. So the columns compare with what a plain blob could
do: everything radial around the centre, and a plane of light, is taken out of image and prediction before they are
compared, as a whole and in halves and quadrants; residuals are summed cell by cell, for misfit has the cells' shape
where noise has none; and white paper is looked for just outside the pattern.
"""

import cv2
import numpy as np
from numpy.typing import NDArray

from peakmark.identification.alignment import Aligned

Column = NDArray[np.float64]

COLUMNS = (
    *("quotient", "correlation", "side", "size_ratio", "moved", "anisotropy", "perspective"),
    *("gain", "michelson", "offset", "contrast_to_noise", "tone", "gain_slope", "offset_slope"),
    *("blur_along", "blur_across", "soft_ratio", "noise_ratio", "last_step", "share", "is_covered"),
    *("unexplained", "blob", "non_radial", "worst_part", "worst_quadrant"),
    *("ring", "ring_low", "side_1", "side_2", "side_4"),
    *("structure", "worst_block", "worst_cell", "one_sided", "regular"),
    *("inner_corner", "core", "arm", "outer_corner", "outer_edge"),
)
"""Evidence of an alignment.

Of the key point: response quotient and coarse correlation. Of the shape: log of the side, of its ratio to the key
point's, distance from it in sides, log of the anisotropy, perspective a side. Of the light: log of the gain, Michelson
contrast, black over gain, log of gain over the image's noise, ln γ, slopes of gain and offset. Of the fit: blur along
and across its direction, in sides; logs of the softened image's ratio (`refine.lit.RATIO`), of residuals over the
image's noise, and of the last step; the share of pixels that nothing covers, and whether any are. Of what is explained:
−log of the share that the pattern leaves; log of what a blob leaves over what the pattern leaves; correlation of what
is not radial; −log(1 − least correlation) over eight halves and quadrants; the least of what is not radial in a
quadrant. Of the rim: share of points just outside that are white, their lower fifth; the lowest two and the highest of
the four sides' mean residuals. Of the cells' mean residuals, over gain: log of their mean square beyond noise, the
largest of a block of 3 × 3 and of one; log of the part that has the pattern's symmetry, and of the rest; and the
symmetric part's values in places of the pattern."""

COVER_COLUMNS = ("sound", "mixed", "hidden_apart", "hidden_inside", "seen_contrast")
"""Evidence of what may be covered: shares of cells that are seen, and in part; of cells that are hidden, shares beside
the largest connected group, and in groups that do not reach the pattern's border, for what lies on a marker comes from
outside and is in one piece; log of the contrast of what is seen, over gain."""

_RIM = np.linspace(-0.525, 0.525, 12)


def marker_evidence(
    gray: NDArray[np.uint8], aligned: Aligned, quotients: Column, correlations: Column, sigma: float
) -> NDArray[np.float64]:
    """Return (n, len(COLUMNS)) of alignments, given their candidates' quotients and correlations, and the noise's σ."""
    columns = {"quotient": quotients, "correlation": correlations}
    columns |= _shape_columns(aligned) | _light_columns(aligned, sigma) | _fit_columns(aligned, sigma)
    columns |= _explained_columns(aligned, sigma) | _rim_columns(gray, aligned) | _cell_columns(aligned, sigma)
    return np.column_stack([columns[name] for name in COLUMNS])


def _shape_columns(aligned: Aligned) -> dict[str, Column]:
    theta, sides = aligned.theta, aligned.sides_px
    stretch = np.linalg.svd(theta[:, 2:6].reshape(-1, 2, 2), compute_uv=False)
    return {
        "side": np.log(sides),
        "size_ratio": np.log(sides / aligned.sizes_px),
        "moved": np.hypot(*(theta[:, :2] - aligned.centers).T) / sides,
        "anisotropy": np.log(stretch[:, 0] / np.maximum(stretch[:, 1], 1e-6)),
        "perspective": np.hypot(theta[:, 6], theta[:, 7]),
    }


def _light_columns(aligned: Aligned, sigma: float) -> dict[str, Column]:
    theta = aligned.theta
    gain, offset = np.maximum(theta[:, 8], 1.0), theta[:, 9]
    return {
        "gain": np.log(gain),
        "michelson": gain / (gain + 2 * np.maximum(offset, 0)),
        "offset": offset / gain,
        "contrast_to_noise": np.log(gain / sigma),
        "tone": theta[:, 15],
        "gain_slope": np.hypot(theta[:, 11], theta[:, 12]),
        "offset_slope": np.hypot(theta[:, 13], theta[:, 14]),
    }


def _fit_columns(aligned: Aligned, sigma: float) -> dict[str, Column]:
    theta, sides = aligned.theta, aligned.sides_px
    apart = np.hypot(theta[:, 16], theta[:, 17])
    return {
        "blur_along": np.sqrt(np.maximum(theta[:, 10] + apart, 0)) / sides,
        "blur_across": np.sqrt(np.maximum(theta[:, 10] - apart, 0)) / sides,
        "soft_ratio": np.log(np.maximum(aligned.ratios, 1e-5)),
        "noise_ratio": np.log(aligned.noise / sigma**2),
        "last_step": np.log10(np.clip(aligned.steps, 1e-2, 1e3)),
        "share": aligned.figures[:, 7],
        "is_covered": (aligned.cuts > 0).astype(np.float64),
    }


def _explained_columns(aligned: Aligned, sigma: float) -> dict[str, Column]:
    count, total, by_blob, left, non_radial, part, quadrant, _ = aligned.figures.T
    expected = count * sigma**2
    beyond_noise = np.maximum(left - expected, 0)
    rest = beyond_noise / np.maximum(total, 1e-9)
    blob = np.maximum(by_blob - expected, 0) / np.maximum(total, 1e-9)
    unexplained = beyond_noise / np.maximum(np.maximum(total - expected, 1e-3 * total), 1e-9)
    return {
        "unexplained": -np.log(unexplained + 0.004),
        "blob": np.log((blob + 0.003) / (rest + 0.003)),
        "non_radial": non_radial,
        "worst_part": -np.log(1 - np.minimum(part, 0.999)),
        "worst_quadrant": quadrant,
    }


def _rim_columns(gray: NDArray[np.uint8], aligned: Aligned) -> dict[str, Column]:
    """Return how white it is just outside the pattern; ½ of those that lie mostly outside the image."""
    theta, sides = aligned.theta, aligned.sides_px
    away = 0.5 + np.clip(1.2 * np.sqrt(np.abs(theta[:, 10]) + 0.1) / sides, 0.06, 0.12)
    edge = np.repeat(away[:, None], len(_RIM), axis=1)
    along = np.broadcast_to(_RIM, edge.shape)
    u = np.concatenate(
        [np.stack(pair, axis=-1) for pair in ((along, -edge), (along, edge), (-edge, along), (edge, along))], 1
    )
    depth = 1 + np.einsum("nki,ni->nk", u, theta[:, 6:8])
    points = theta[:, None, :2] + np.einsum("nij,nkj->nki", theta[:, 2:6].reshape(-1, 2, 2), u) / depth[:, :, None]
    inside = ((points >= 0) & (points < np.array(gray.shape[::-1]) - 1)).all(axis=2)
    x, y = np.ascontiguousarray(points.transpose(2, 0, 1), dtype=np.float32)
    levels = np.asarray(cv2.remap(gray, x, y, cv2.INTER_LINEAR)) if len(x) else np.zeros(x.shape)
    away_from_anchor = (points - aligned.centers[:, None]) / aligned.sizes_px[:, None, None]
    light = np.maximum(1 + np.einsum("nki,ni->nk", away_from_anchor, theta[:, 11:13]), 0.2)
    shade = np.einsum("nki,ni->nk", away_from_anchor, theta[:, 13:15])
    gain = theta[:, 8, None]
    relative = np.where(inside, (levels - theta[:, 9, None] - gain * shade) / (gain * light), np.nan)
    known = inside.sum(axis=1) >= len(_RIM)
    relative[~known] = 0.5
    white = (relative > 0.85).sum(axis=1) / np.maximum(inside.sum(axis=1), 1)
    return {"ring": np.where(known, white, 0.5), "ring_low": _known_quantile(relative, 0.2)}


def _known_quantile(values: NDArray[np.float64], share: float) -> Column:
    """Return (n,) quantiles, linear between values (n, k), of those that are not nan, one at least."""
    rising, rows = np.sort(values, axis=1), np.arange(len(values))  # nan comes last
    at = share * (np.isfinite(values).sum(axis=1) - 1)
    low = np.floor(at).astype(np.intp)
    return np.asarray(rising[rows, low] + (at - low) * (rising[rows, np.ceil(at).astype(np.intp)] - rising[rows, low]))


def _cell_columns(aligned: Aligned, sigma: float) -> dict[str, Column]:
    counts = aligned.counts
    mean = np.where(counts > 0, aligned.sums / np.maximum(counts, 1), 0.0)
    rims = zip(_rims_of(mean), _rims_of(counts), strict=True)
    sides = np.sort(np.column_stack([_mean_of(*rim) for rim in rims]), axis=1)
    inner, inside = mean[:, 1:-1, 1:-1], counts[:, 1:-1, 1:-1]
    pixels = np.maximum(inside.sum(axis=(1, 2)), 1)
    noise = (sigma / np.maximum(aligned.theta[:, 8], 1)) ** 2 * (inside > 0).sum(axis=(1, 2))
    blocks = [np.s_[:, i : i + 3, j : j + 3] for i in (0, 3, 6) for j in (0, 3, 6)]
    turned = inner + inner[:, ::-1] + inner[:, :, ::-1] + inner[:, ::-1, ::-1]
    regular = (turned + turned.transpose(0, 2, 1)) / 8
    return {
        **{f"side_{k + 1}": sides[:, k] for k in (0, 1, 3)},
        "structure": np.log(np.maximum(((inner**2 * inside).sum(axis=(1, 2)) - noise) / pixels, 1e-6)),
        "worst_block": np.max([np.abs(_mean_of(inner[block], inside[block])) for block in blocks], axis=0),
        "worst_cell": np.abs(inner).max(axis=(1, 2), initial=0),
        "one_sided": np.log(np.sqrt(((inner - regular) ** 2).mean(axis=(1, 2))) + 1e-3),
        "regular": np.log(np.sqrt((regular**2).mean(axis=(1, 2))) + 1e-3),
        "inner_corner": regular[:, 2, 2],
        "core": regular[:, 3:6, 3:6].mean(axis=(1, 2)),
        "arm": regular[:, 2, 3:6].mean(axis=1),
        "outer_corner": regular[:, :2, :2].mean(axis=(1, 2)),
        "outer_edge": regular[:, 0, 3:6].mean(axis=1),
    }


def cover_columns(aligned: Aligned) -> dict[str, Column]:
    """Return the `COVER_COLUMNS` (n,) of alignments."""
    seen = (aligned.counts / np.maximum(aligned.pixels, 1))[:, 1:-1, 1:-1]
    seen = np.where(aligned.pixels[:, 1:-1, 1:-1] > 0, seen, 1.0)
    shares = np.array([_hidden_shares(one < 0.5) for one in seen]).reshape(-1, 2)
    count, total = aligned.figures[:, 0], aligned.figures[:, 1]
    return {
        "sound": (seen > 0.75).mean(axis=(1, 2)),
        "mixed": ((seen > 0.25) & (seen < 0.75)).mean(axis=(1, 2)),
        "hidden_apart": shares[:, 0],
        "hidden_inside": shares[:, 1],
        "seen_contrast": np.log(total / np.maximum(count, 1) / np.maximum(aligned.theta[:, 8], 1) ** 2 + 1e-4),
    }


def _hidden_shares(hidden: NDArray[np.bool_]) -> tuple[float, float]:
    """Return shares of the hidden cells (9, 9): not in the largest connected group, and in groups within the border."""
    total = int(hidden.sum())
    if total == 0:
        return 0.0, 0.0
    count, groups = cv2.connectedComponents(hidden.astype(np.uint8), connectivity=4)
    sizes = np.bincount(np.ravel(groups), minlength=count)[1:]
    at_border = np.unique(np.concatenate([groups[0], groups[-1], groups[:, 0], groups[:, -1]]))
    reaching = sum(int(sizes[k - 1]) for k in at_border if k > 0)
    return 1 - float(sizes.max()) / total, 1 - reaching / total


def _rims_of(cells: NDArray[np.float64]) -> tuple[NDArray[np.float64], ...]:
    """Return the four sides (n, 9) of cells (n, 11, 11) beyond the pattern."""
    return cells[:, 0, 1:-1], cells[:, -1, 1:-1], cells[:, 1:-1, 0], cells[:, 1:-1, -1]


def _mean_of(mean: NDArray[np.float64], counts: NDArray[np.float64]) -> Column:
    """Return (n,) means over cells (n, …), each with its number of pixels."""
    axes = tuple(range(1, mean.ndim))
    return np.asarray((mean * counts).sum(axis=axes) / np.maximum(counts.sum(axis=axes), 1))
