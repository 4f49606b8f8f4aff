"""Key points → how much they look like a marker: response, version-independent signature, size (paper, Figure 14).

The paper separates markers by a response threshold and suggests an oblique line, or something nonlinear. A
`Classifier` is any of them: a chain of affine layers with tanh between them; one layer is a line. The one that ships,
`classifier.json`, is plain numbers; `scripts/train_classifier.py` makes it again.
"""

import json
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray
from peaksim.text_file import read_text

from peakmark.errors import InputError
from peakmark.plain import from_plain

COLUMNS = ("log_response", "vis_distance", "log_size", "quotient")
"""What is known of a key point: log₁₀ of the response, VIS distance, log₁₀ of the scale in px, and the response over
the largest that an image of the same contrast could give (`evidence.response_quotients`)."""

SHIPPED = Path(__file__).with_name("classifier.json")

_LARGEST_FILE = 1_000_000  # bytes


@dataclass(frozen=True)
class Layer:
    """An affine layer."""

    weights: NDArray[np.float64]
    """(inputs, outputs)."""
    offsets: NDArray[np.float64]
    """(outputs,)."""


@dataclass(frozen=True)
class Classifier:
    """A score of key points, and the operating point from which they count as markers."""

    columns: tuple[str, ...]
    """Names out of `COLUMNS`."""
    mean: NDArray[np.float64]
    """(c,) subtracted from the columns."""
    scale: NDArray[np.float64]
    """(c,) by which they are divided then."""
    layers: tuple[Layer, ...]
    """In order; the last has one output."""
    threshold: float
    """Scores above it are markers."""

    def scores(self, evidence: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return (n,) log odds of (n, len(COLUMNS)) evidence."""
        chosen = [COLUMNS.index(name) for name in self.columns]
        values = (evidence[:, chosen] - self.mean) / self.scale
        for layer in self.layers[:-1]:
            values = np.tanh(values @ layer.weights + layer.offsets)
        return np.asarray(values @ self.layers[-1].weights + self.layers[-1].offsets)[:, 0]

    @classmethod
    def from_plain(cls, content: Any) -> Self:
        """Build a classifier from plain values; keys that it does not know are ignored.

        Raises
        ------
        InputError
            If a key is missing, a column unknown, a number not finite, or the shapes do not chain.
        """
        try:
            classifier = from_plain(cls, {**content, "threshold": float(content["threshold"])})
        except (KeyError, TypeError, ValueError) as error:
            raise InputError(f"classifier: expected columns, mean, scale, layers and threshold: {error!r}") from error
        _check(classifier)
        return classifier


def _check(classifier: Classifier) -> None:
    unknown = [name for name in classifier.columns if name not in COLUMNS]
    if unknown or not classifier.columns:
        raise InputError(f"classifier: expected columns out of {', '.join(COLUMNS)}, got {unknown}")
    width = len(classifier.columns)
    numbers = [classifier.mean, classifier.scale, np.array(classifier.threshold)]
    fits = classifier.mean.shape == classifier.scale.shape == (width,)
    for layer in classifier.layers:
        weights, offsets = layer.weights, layer.offsets
        fits = fits and weights.ndim == 2 and weights.shape[0] == width and offsets.shape == weights.shape[1:]
        numbers += [weights, offsets]
        width = weights.shape[-1] if weights.ndim else 0
    if not (fits and width == 1 and classifier.layers):
        raise InputError("classifier: expected layers whose shapes chain from the columns to one score")
    if not all(np.isfinite(values).all() for values in numbers) or not (classifier.scale > 0).all():
        raise InputError("classifier: expected finite numbers and positive scales")


def load_classifier(path: str | Path) -> Classifier:
    """Read a classifier from a JSON file of at most 1 MB; one that cannot be read or is none is an `InputError`."""
    try:
        content = json.loads(read_text(Path(path), _LARGEST_FILE))
    except (json.JSONDecodeError, RecursionError) as error:
        raise InputError(f"{path}: is not JSON: {error}") from error
    try:
        return Classifier.from_plain(content)
    except InputError as error:
        raise InputError(f"{path}: {error}") from error


@cache
def shipped_classifier() -> Classifier:
    """Return the classifier that comes with the package."""
    return load_classifier(SHIPPED)
