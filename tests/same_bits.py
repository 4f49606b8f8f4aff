"""Prints hashes of what the kernels make of the golden inputs; `test_same_bits.py` compares builds and compilers."""

import hashlib
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray
from peaksim.native import Function

from peakmark.identification.blobs import blob_rows
from tests import refine_golden, surf_golden
from tests.peaksim.area.golden_views import VIEWS


def hash_of(columns: Mapping[str, NDArray[Any]]) -> str:
    """Return the SHA-256 of columns, by name."""
    digest = hashlib.sha256()
    for name in sorted(columns):
        digest.update(name.encode() + np.ascontiguousarray(columns[name]).tobytes())
    return digest.hexdigest()


def elementary() -> dict[str, NDArray[Any]]:
    """Return exp, log, sin, cos, tan and atan over the same numbers."""
    values = Function("void elementary_values(i4 function, const f8[n] x, f8[n] values)")
    x = np.linspace(-30, 30, 10_001)
    found = {str(k): np.empty_like(x) for k in range(6)}
    for k in range(6):
        values(k, np.abs(x) + 1e-3 if k == 1 else x, found[str(k)])
    return found


def hashes() -> dict[str, str]:
    """Return what identification, its candidates, SURF, the renderer and the elementary functions give."""
    with np.load(refine_golden.PATH) as golden:
        views = refine_golden.Views(golden["image"], golden["xy"], golden["sides_px"])
    with np.load(surf_golden.PATH) as golden:
        gray = golden["image"]
    return {
        "elementary": hash_of(elementary()),
        "surf": hash_of(surf_golden.measure(gray)),
        "refine": hash_of(refine_golden.measure(views)),
        "blobs": hash_of({"rows": blob_rows(gray, 100.0, 0.1)}),
        "exact": hash_of({name: draw() for name, draw in VIEWS.items()}),
    }


if __name__ == "__main__":
    for name, value in hashes().items():
        print(name, value)
