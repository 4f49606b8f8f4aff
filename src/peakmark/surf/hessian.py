"""The search for SURF's interest points: responses, threshold and 3×3×3 maxima fused, row by row, in C.

No response layer is stored. Of each searched layer of an octave three grid rows stay in cache, and a row is searched
as soon as the row below it is known. The lowest and the highest layer of an octave only serve as neighbours; they are
computed where a candidate asks for them. Quick responses rest on exact integer sums and differ from OpenCV's in the
last bits, because OpenCV rounds every box mean to single precision; every candidate is settled in OpenCV's own
arithmetic (`native/surf_exact.c`), so that key points, responses and their order are OpenCV's.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from peaksim.native import function

from peakmark.keypoints.keypoints import Keypoints
from peakmark.parallel import bands, map_parallel, thread_count
from peakmark.surf.layers import Layer

RECORD_FIELDS = ("x", "y", "scale", "size", "response", "octave", "laplacian")
"""Columns of the (n, 7) float32 records that the kernel returns."""

_BANDS_PER_THREAD = 4
"""Bands of rows that a thread gets in the first octave, so that threads end together."""
BLOCK_COLUMNS = 1024
"""Columns of a block, so that a searched layer's three rows stay in the first cache (`benchmarks/stages.py`)."""
_find_in_block = function(
    "status find_in_block(const i4[height,stride] integral, const i4[height,stride]? mask, f4 threshold, i8 octave, "
    "i8 layers, i8 rows, i8 columns, i8 top, i8 bottom, i8 left, i8 right, f4[room,7] records, i8[1] count)"
)


class Block(NamedTuple):
    """Part of an octave's grid, half-open, in which one task looks for maxima."""

    octave: int
    layers: int
    rows: int
    """Rows of the whole grid."""
    columns: int
    """Columns of the whole grid."""
    top: int
    bottom: int
    left: int
    right: int


def find_interest_points(
    integral: NDArray[np.int32],
    shape: tuple[int, int],
    threshold: float,
    octaves: int,
    layers: int,
    mask_integral: NDArray[np.int32] | None,
) -> NDArray[np.float32]:
    """All interest points as (n, 7) records (`RECORD_FIELDS`), in no particular order.

    Parameters
    ----------
    integral : (H + 1, at least W + 1) contiguous int32 array, see `padded_integral`.
    shape : (H, W) of the image, px.
    threshold : a response must be larger, (grey levels)².
    octaves, layers : as in `stages.hessian_responses`.
    mask_integral : the same for the mask as zeros and ones; None accepts every position.
    """
    blocks = [block for octave in range(octaves) for block in grid_blocks(shape, octave, layers)]
    found = map_parallel(lambda block: _search(integral, mask_integral, threshold, block), blocks)
    return np.concatenate([np.zeros((0, len(RECORD_FIELDS)), dtype=np.float32), *found])


def _search(
    integral: NDArray[np.int32], mask_integral: NDArray[np.int32] | None, threshold: float, block: Block
) -> NDArray[np.float32]:
    """Return the records of the maxima in a block; of four grid positions in a square at most one is one of a layer."""
    height, width = block.bottom - block.top, block.right - block.left
    room = block.layers * ((height + 1) // 2) * ((width + 1) // 2)
    records, count = np.empty((room, len(RECORD_FIELDS)), dtype=np.float32), np.empty(1, dtype=np.int64)
    _find_in_block(integral, mask_integral, threshold, *block, records, count)
    return records[: count[0]].copy()


def strongest_first(records: NDArray[np.float32]) -> NDArray[np.intp]:
    """Row order of OpenCV: response falling, then size falling, octave falling, y falling, x rising."""
    x, y, _, size, response, octave, _ = records.T
    order = np.argsort(-response)
    ranked = response[order]
    equal = np.zeros(len(ranked) + 1, dtype=bool)
    equal[1:-1] = ranked[1:] == ranked[:-1]
    ties = equal[:-1] | equal[1:]
    tied = order[ties]
    order[ties] = tied[np.lexsort((x[tied], -y[tied], -octave[tied], -size[tied], -response[tied]))]
    return order


def to_keypoints(records: NDArray[np.float32], angles: NDArray[np.float32] | np.float32) -> Keypoints:
    """Return records as key points of these angles, degrees."""
    return Keypoints(
        xy=records[:, :2].copy(),
        size=records[:, 3].copy(),
        angle=np.broadcast_to(angles, len(records)).copy(),
        response=records[:, 4].copy(),
        octave=records[:, 5].astype(np.int32),
        laplacian=records[:, 6].astype(np.int8),
        scale=records[:, 2].copy(),
    )


def grid_blocks(shape: tuple[int, int], octave: int, layers: int) -> list[Block]:
    """Blocks that tile the searched positions of an octave, sized for the cache and cut for the threads."""
    rows, columns = (length >> octave for length in shape)
    margin = Layer(octave, 1).margin
    height, width = rows - 2 * margin, columns - 2 * margin
    if height <= 0 or width <= 0:
        return []
    row_cuts = max(1, (thread_count() * _BANDS_PER_THREAD) >> octave)
    return [
        Block(octave, layers, rows, columns, margin + top, margin + bottom, margin + left, margin + right)
        for top, bottom in bands(height, row_cuts)
        for left, right in bands(width, -(-width // BLOCK_COLUMNS))
    ]
