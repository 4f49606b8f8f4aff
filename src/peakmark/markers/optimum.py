"""Patterns that maximise a detection operator at one position, with a proof of how far from optimal they can be.

A detector's response at a fixed position and scale is a function of the n pixels x under its window: linear,
``w·x`` (DoG, Laplacian), or quadratic, ``q(x) = (F x)ᵀ M (F x)`` with k filters F and a symmetric (k, k)
form M (Hessian determinant). The pattern x is limited either in energy, ‖x‖₂ ≤ 1, as in Section 3 of the
paper, or in range, |xᵢ| ≤ 1, as print and 8-bit images are.
"""

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from peakmark.errors import InputError, check_choice

Limit = Literal["energy", "range"]

_MAX_STEPS = 2000
"""Of either ascent; the gap tells where it ended too early."""

_GAP = 1e-9
"""Relative gap to the bound that counts as met: rounding."""

_STARTS = 16
"""Leading eigenvectors from which corners of the cube are sought."""


@dataclass(frozen=True)
class Optimum:
    """A pattern and how good it provably is."""

    x: NDArray[np.float64]
    """The pattern, in the filters' shape; its negative is as good for a quadratic operator."""
    value: float
    """The operator's response to `x`."""
    bound: float
    """No pattern within the limit exceeds this response."""

    @property
    def gap(self) -> float:
        """Relative distance to the bound; 0 (to rounding) proves that `x` is optimal."""
        return (self.bound - self.value) / abs(self.bound) if self.bound else 0.0


def linear_optimum(weights: ArrayLike, limit: Limit) -> Optimum:
    """Return the optimum of ``w·x``: the matched filter w/‖w‖₂ under "energy", sign(w) under "range".

    Both reach their bound (Cauchy–Schwarz, Hölder). Pixels of weight 0 stay at 0.
    """
    check_choice(limit, get_args(Limit), "limit")
    w = _finite(weights, "weights")
    norm = float(np.linalg.norm(w)) if limit == "energy" else float(np.abs(w).sum())
    x = w / max(norm, np.finfo(float).tiny) if limit == "energy" else np.sign(w)
    return Optimum(x, float((w * x).sum()), norm)


def quadratic_optimum(filters: ArrayLike, form: ArrayLike, limit: Limit) -> Optimum:
    """Return the optimum of ``q(x) = (F x)ᵀ M (F x)``.

    Parameters
    ----------
    filters
        (k, ...) the k linear filters F, each of the pattern's shape.
    form
        (k, k) symmetric M.
    limit
        "energy": the eigenvector of Fᵀ M F to the algebraically largest eigenvalue λ, bound λ (Section 3.2).
        "range": globally optimal where Fᵀ M F has one positive eigenvalue, as every Hessian determinant with
        a Dxy weight ≥ 0 has (see `_cone_optimum`); else the best of a local search, with an upper bound.

    Raises
    ------
    InputError
        If shapes do not fit, the limit is unknown, M is not symmetric, a number is not finite, or q is nowhere
        positive.
    """
    check_choice(limit, get_args(Limit), "limit")
    F = _finite(filters, "filters")
    M = _finite(form, "form")
    if F.ndim < 2 or M.shape != (len(F), len(F)) or not np.allclose(M, M.T):
        raise InputError(f"form: expected a symmetric matrix for {len(F)} filters, got shape {M.shape}")
    rows = F.reshape(len(F), -1)
    values, vectors = eigenpatterns(rows, M)
    if not len(values):
        raise InputError("form: expected an operator that is positive somewhere, got one that never is")
    if limit == "energy":
        best = Optimum(vectors[0], quadratic(vectors[0], rows, M), float(values[0]))
    elif len(values) == 1:
        best = _cone_optimum(rows, M, vectors[0])
    else:
        best = _vertex_search(rows, M, values, vectors)
    return Optimum(best.x.reshape(F.shape[1:]), best.value, best.bound)


def quadratic(x: NDArray[np.float64], filters: NDArray[np.float64], form: NDArray[np.float64]) -> float:
    """Return ``(F x)ᵀ M (F x)`` of a pattern of the filters' shape."""
    z = filters.reshape(len(filters), -1) @ x.ravel()
    return float(z @ form @ z)


def eigenpatterns(
    filters: NDArray[np.float64], form: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the positive eigenvalues (m,) of Fᵀ M F, falling, and unit eigenvectors (m, ...) as patterns.

    With Fᵀ = Q R the n×n problem shrinks to the k×k matrix R M Rᵀ, so any kernel side is cheap.
    Signs are chosen so that the entry largest by magnitude is negative (a dark centre).
    """
    Q, R = np.linalg.qr(filters.reshape(len(filters), -1).T)
    values, vectors = np.linalg.eigh(R @ form @ R.T)
    positive = np.flatnonzero(values > 1e-12 * np.abs(values).max(initial=0.0))[::-1]
    patterns = (Q @ vectors[:, positive]).T
    peaks = np.take_along_axis(patterns, np.abs(patterns).argmax(axis=1)[:, None], axis=1)
    return values[positive], (-np.sign(peaks) * patterns).reshape(len(positive), *filters.shape[1:])


def _cone_optimum(rows: NDArray[np.float64], form: NDArray[np.float64], start: NDArray[np.float64]) -> Optimum:
    """Return the global optimum over |xᵢ| ≤ 1 where A = Fᵀ M F has one positive eigenvalue, with its proof.

    {q ≥ 0} is then a double Lorentz cone, and on it the reverse Cauchy–Schwarz inequality
    (xᵀA y)² ≥ q(x) q(y) holds. Hence for every y in the cube q(y) ≤ (xᵀA y)² / q(x) ≤ ‖A x‖₁² / q(x): any x
    in the cone bounds the optimum, and a pattern with x = sign(A x) is proven globally optimal. √q is concave
    in the cone, so where no binary pattern meets the bound, a smooth ascent does.
    """
    x = _sign_iterated(rows, form, start)
    if _cone_certified(x, rows, form).gap > _GAP:
        x = _concave_ascent(x, rows, form)
    return _cone_certified(x, rows, form)


def _cone_certified(x: NDArray[np.float64], rows: NDArray[np.float64], form: NDArray[np.float64]) -> Optimum:
    value = quadratic(x, rows, form)
    return Optimum(x, value, float(np.abs(rows.T @ (form @ (rows @ x))).sum()) ** 2 / value)


def _vertex_search(
    rows: NDArray[np.float64], form: NDArray[np.float64], values: NDArray[np.float64], vectors: NDArray[np.float64]
) -> Optimum:
    """Return the best corner of the cube that x ← sign(A x) reaches from any of the leading eigenvectors.

    With several positive eigenvalues this is a local search (the problem is NP-hard). Two bounds hold:
    q(y) ≤ λ ‖y‖² ≤ λ n, and q(y) ≤ Σ μ ‖Fᵀu‖₁² over M's positive eigenpairs (μ, u).
    """
    found = [_sign_iterated(rows, form, start) for start in vectors[:_STARTS]]
    x = max(found, key=lambda x: quadratic(x, rows, form))
    weights, axes = np.linalg.eigh(form)
    filterwise = float(np.maximum(weights, 0) @ np.abs(axes.T @ rows).sum(axis=1) ** 2)
    return Optimum(x, quadratic(x, rows, form), min(float(values[0]) * x.size, filterwise))


def _sign_iterated(
    rows: NDArray[np.float64], form: NDArray[np.float64], start: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Follow x ← sign(A x) from a start, stretched to the range, while q rises."""
    x = start / np.abs(start).max()
    for _ in range(_MAX_STEPS):
        target = _sign(rows.T @ (form @ (rows @ x)))
        if quadratic(target, rows, form) <= quadratic(x, rows, form):
            break
        x = target
    return np.asarray(x)


def _concave_ascent(
    start: NDArray[np.float64], rows: NDArray[np.float64], form: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the maximum of log q over the cube |xᵢ| ≤ 1, from a start with q > 0.

    Below half the start's value log q continues as its tangent, so that the line search may leave the cone.
    """
    floor = quadratic(start, rows, form) / 2

    def negative_log(x: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
        z = rows @ x
        outer = form @ z
        value = float(z @ outer)
        held = max(value, floor)
        return (held - value) / held - float(np.log(held)), -2 * (rows.T @ outer) / held

    options = {"maxiter": _MAX_STEPS, "ftol": 1e-15, "gtol": 1e-12}
    bounds = [(-1, 1)] * start.size
    from scipy.optimize import minimize

    result = minimize(negative_log, start, jac=True, method="L-BFGS-B", bounds=bounds, options=options)
    return np.asarray(result.x)


def _sign(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return −1, 0 or 1, with rounding noise counted as 0."""
    return np.asarray(np.sign(np.where(np.abs(values) > 1e-9 * np.abs(values).max(), values, 0.0)))


def _finite(values: ArrayLike, name: str) -> NDArray[np.float64]:
    array = np.asarray(values, dtype=np.float64)
    if array.size == 0 or not np.isfinite(array).all():
        raise InputError(f"{name}: expected finite numbers, got shape {array.shape} with nan, inf or nothing")
    return array
