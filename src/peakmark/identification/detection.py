"""What identification returns: detections, and everything that was found in one image."""

from dataclasses import dataclass
from typing import Any, get_args

import numpy as np
from numpy.typing import NDArray

from peakmark.errors import check_choice
from peakmark.keypoints.keypoints import Keypoints
from peakmark.markers.optimum import Limit
from peakmark.markers.patterns import Made, Polarity, Variant, check_pattern

SIDE_OF_SCALE = 1.09
"""Side of a marker over its SURF scale, in the median: the filter that answers most is a little smaller."""


_CORNERS = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])


@dataclass(frozen=True, eq=False)
class FitSpread:
    """How far an alignment's (x, y, a11, a12, a21, a22, g1, g2) is off: centre, affinity, perspective; px and sides.

    The alignment takes perspective for slight, which draws all of it: to a true perspective g it finds, on average, the
    truth less `drawn` g.
    """

    covariance: NDArray[np.float64]
    """(8, 8) around that."""
    drawn: NDArray[np.float64]
    """(8, 2)."""


@dataclass(frozen=True)
class Detection:
    """An identified marker."""

    id: int
    """0, 1, … by falling response; −1 of a marker that was found only where one of an array had to be."""
    xy: NDArray[np.float64]
    """(2,) centre in the given image, px, pixel centres at integers; refined where `affinity` is given."""
    size: float
    """Side of the pattern in the given image (square root of its area), px."""
    polarity: Polarity | None
    """"dark" or "light" centre; None only from a user's detector that does not tell."""
    response: float
    """Determinant of the Hessian; of a SIFT marker the size of the DoG, grey levels 0…1."""
    signature_distance: float
    """Euclidean distance from the ideal marker's signature; nan where no descriptor was computed."""
    rank: int
    """1-based rank of the feature by response among all features of the image."""
    affinity: NDArray[np.float64] | None = None
    """(2, 2) px per side of the pattern's x and y axes at the centre; None where nothing was refined."""
    explained: float | None = None
    """Share of the grey levels' variance that the printed pattern explains, 0…1; None where nothing was refined."""
    probability: float | None = None
    """That it is a marker, 0…1, by the model of the general search; None by the other rules."""
    perspective: NDArray[np.float64] | None = None
    """(2,) g of ``x = xy + affinity u / (1 + g·u)``, per side, of a pattern point u; None by the other rules."""
    covariance: NDArray[np.float64] | None = None
    """(2, 2) of the centre, px², from the residuals of the alignment; None by the other rules."""
    spread: "FitSpread | None" = None
    """How far centre, affinity and perspective may be off together; None where `covariance` is."""
    limit: Limit = "energy"
    """Of its pattern: "energy", the paper's, or "range", the binary one."""
    made_for: Made = "surf"
    """The detector that its pattern is made for: "surf" or "sift"."""
    aside: NDArray[np.float64] | None = None
    """(2,) px, of a disc by the general search: its centre is seen at about `xy` + `aside` or `xy` − `aside`, and
    nothing of the disc tells which, see `peakmark.refine.Refined`; the covariance holds it."""

    @property
    def kind(self) -> str:
        """What scenes, truth and sheets call it, such as "sift-range-light"; dark where nothing tells."""
        return Variant(self.polarity or "dark", self.limit, self.made_for).kind

    def corners(self) -> NDArray[np.float64]:
        """Return (4, 2) corners of the pattern, px, from its top left clockwise; upright where nothing was refined."""
        affinity = self.size * np.eye(2) if self.affinity is None else self.affinity
        depth = np.ones(4) if self.perspective is None else 1 + _CORNERS @ self.perspective
        return np.asarray(self.xy + _CORNERS @ affinity.T / depth[:, None])


def expected_detection(variant: Variant, **measured: Any) -> Detection:
    """Return a marker that is seen where one had to stand: id −1, rank 0, without a response and a signature."""
    return Detection(
        id=-1,
        polarity=variant.polarity,
        limit=variant.limit,
        made_for=variant.made_for,
        response=0.0,
        signature_distance=np.nan,
        rank=0,
        **measured,
    )


@dataclass(frozen=True)
class Identification:
    """Everything found in one image: what the figures of Section 4.2 are drawn from."""

    features: Keypoints
    """All features, strongest first, in the given (unstretched) image."""
    signature_distances: NDArray[np.float32]
    """(n,) of the features from the reference."""
    detections: tuple[Detection, ...]
    """The markers, strongest first."""


def pattern_name(polarity: Polarity, limit: Limit, made_for: Made = "surf") -> str:
    """Return what `peakmark.refine` calls the marker of a polarity and limit."""
    check_pattern(polarity, limit)
    return Variant(polarity, limit, made_for).kind


def is_polarity(features: Keypoints, polarity: Polarity) -> NDArray[np.bool_]:
    """Return (n,) whether features have a dark or light centre: OpenCV's class_id is +1 for a dark one."""
    check_choice(polarity, get_args(Polarity), "polarity")
    return np.asarray(features.laplacian == (1 if polarity == "dark" else -1))


def unrefined_detections(
    features: Keypoints, distances: NDArray[np.float32], polarity: Polarity | None, rows: NDArray[np.intp]
) -> tuple[Detection, ...]:
    """Return features as detections, in the order given, with the positions and sizes that SURF tells.

    Without a polarity the sign of each feature's Laplacian tells it.
    """
    is_dark = is_polarity(features, "dark")
    return tuple(
        Detection(
            id=number,
            xy=features.xy[row].astype(np.float64),
            size=float(features.scale[row]),
            polarity=polarity or ("dark" if is_dark[row] else "light"),
            response=float(features.response[row]),
            signature_distance=float(distances[row]),
            rank=int(row) + 1,
        )
        for number, row in enumerate(rows)
    )
