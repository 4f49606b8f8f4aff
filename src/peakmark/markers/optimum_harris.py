"""The picture of greatest Harris corner response at one place: a quartic, bounded by a quadratic.

With the structure tensor S = Σ w(p) ∇x(p) ∇x(p)ᵀ over a fixed window, ``R = det S − κ (tr S)²``. As det S ≤
(tr S / 2)², ``R ≤ (¼ − κ)(tr S)²``, and tr S is a positive quadratic form of the picture, so
`quadratic_optimum` bounds R. The bound is met where S is isotropic. Window and derivative look the same after
a quarter turn, so an eigenvector that is unique up to sign does too, and its S is isotropic: proven optimal.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from peakmark.errors import InputError
from peakmark.markers.optimum import Limit, Optimum, eigenpictures, quadratic_optimum

SOBEL = np.array([[-1.0, 0.0, 1.0], [-2.0, 0.0, 2.0], [-1.0, 0.0, 1.0]]) / 8
"""Horizontal derivative of the usual Harris detector."""

_MAX_STEPS = 500
_STARTS = 16


def harris_optimum(window: ArrayLike, limit: Limit, kappa: float = 0.04, derivative: ArrayLike = SOBEL) -> Optimum:
    """Return the picture of greatest Harris response at the window's centre.

    Parameters
    ----------
    window
        (m, m) weights w ≥ 0.
    limit
        "energy" or "range".
    kappa
        Harris's κ, 0…0.25.
    derivative
        (d, d) filter of ∂/∂x; its transpose is that of ∂/∂y. The picture has side m + d − 1.

    Raises
    ------
    InputError
        If the window is not square or has negative weights, or κ is out of range.
    """
    weights = np.asarray(window, dtype=np.float64)
    if weights.ndim != 2 or weights.shape[0] != weights.shape[1] or not (weights >= 0).all():
        raise InputError(f"window: expected a square of weights ≥ 0, got shape {weights.shape}")
    if not 0 <= kappa < 0.25:
        raise InputError(f"kappa: expected 0 ≤ κ < 0.25, got {kappa}")
    gradients = gradient_filters(weights, np.asarray(derivative, dtype=np.float64))
    both = gradients.reshape(-1, *gradients.shape[2:])
    trace = quadratic_optimum(both, np.eye(len(both)), limit)
    starts = [trace.x, *eigenpictures(both, np.eye(len(both)))[1][:_STARTS]]
    found = [_ascend(start, gradients, kappa, limit) for start in starts]
    x = max(found, key=lambda x: harris_response(x, gradients, kappa))
    return Optimum(x, harris_response(x, gradients, kappa), (0.25 - kappa) * trace.bound**2)


def gradient_filters(weights: NDArray[np.float64], derivative: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return (2, m², s, s): √w-weighted ∂x and ∂y filters at every place of the window, s = m + d − 1."""
    m, d = len(weights), len(derivative)
    filters = np.zeros((2, m, m, m + d - 1, m + d - 1))
    for row, column in np.ndindex(m, m):
        for axis, kernel in enumerate((derivative, derivative.T)):
            filters[axis, row, column, row : row + d, column : column + d] = np.sqrt(weights[row, column]) * kernel
    return filters.reshape(2, m * m, m + d - 1, m + d - 1)


def harris_response(x: NDArray[np.float64], gradients: NDArray[np.float64], kappa: float) -> float:
    """Return ``det S − κ (tr S)²`` of a picture; `gradients` as from `gradient_filters`."""
    S = _tensor(x, gradients)[1]
    return float(np.linalg.det(S) - kappa * np.trace(S) ** 2)


def _tensor(x: NDArray[np.float64], gradients: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the gradients (2, m²) at the window's places and the structure tensor (2, 2)."""
    g = np.tensordot(gradients, x, axes=2)
    return g, g @ g.T


def _ascend(x: NDArray[np.float64], gradients: NDArray[np.float64], kappa: float, limit: Limit) -> NDArray[np.float64]:
    """Climb from `x` towards the picture that the gradient of R asks for, while that helps."""
    for _ in range(_MAX_STEPS):
        g, S = _tensor(x, gradients)
        cofactor = np.array([[S[1, 1], -S[0, 1]], [-S[0, 1], S[0, 0]]])
        slope = np.tensordot((cofactor - 2 * kappa * np.trace(S) * np.eye(2)) @ g, gradients, axes=2)
        target = slope / np.linalg.norm(slope) if limit == "energy" else np.sign(slope)
        if harris_response(target, gradients, kappa) <= harris_response(x, gradients, kappa) * (1 + 1e-12):
            return x
        x = target
    return x
