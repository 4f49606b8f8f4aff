"""What a photograph shows of a printed board: where each of its markers is seen."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from peakmark.found.found import Found
from peakmark.localise.residuals import refined_sigmas
from peakmark.maps.marker_map import MarkerMap

FEWEST = 8
"""Markers that a photograph must show: one array of a board."""


@dataclass(frozen=True)
class BoardView:
    """One photograph of a flat board."""

    name: str
    """The photograph."""
    rows: NDArray[np.intp]
    """(n,) markers of the board, as indices into its map."""
    points_m: NDArray[np.float64]
    """(n, 3) their centres on the board."""
    xy: NDArray[np.float64]
    """(n, 2) where they are seen, px."""
    sigma_px: NDArray[np.float64]
    """(n,) expected errors along each axis, px, up to a factor common to all."""

    def without(self, rejected: NDArray[np.bool_]) -> "BoardView":
        """Return the view without some of its markers."""
        kept = ~rejected
        return BoardView(self.name, self.rows[kept], self.points_m[kept], self.xy[kept], self.sigma_px[kept])


def board_view(name: str, found: Found, board: MarkerMap) -> BoardView | str:
    """Return the view of a board's markers in an image, or in words why there is none."""
    rows_of = {array.code: array.rows for array in board.arrays}
    read = [array for array in found.arrays if array.code in rows_of]
    markers = [
        (row, d) for array in read for row, d in zip(rows_of[int(array.code or 0)], array.detections, strict=True)
    ]
    markers = [(row, d) for row, d in markers if d.affinity is not None]
    if len(markers) < FEWEST:
        return f"shows {len(markers)} markers of the board's arrays, of at least {FEWEST} needed"
    rows = np.array([row for row, _ in markers], dtype=np.intp)
    if board.pages is not None and len(set(board.pages[rows])) > 1:
        return "shows several sheets of paper, which are no board"
    sigma, _ = refined_sigmas(np.array([d.affinity for _, d in markers]))
    return BoardView(name, rows, board.centers_m[rows], np.array([d.xy for _, d in markers]), sigma)
