"""Where a pattern may lie, told by correlation alone: a few steps of coarse alignment.

Block means in which the pattern has 12 px a side and more are softened, and a plane of light is taken out.
"""

import numpy as np
from numpy.typing import NDArray
from peaksim.native import function

Values = NDArray[np.float64]

_view_candidates = function(
    "status view_candidates(const u1[height,width] gray, const f8[n,2] xy, const f8[n] sides, "
    "const f8[sample_count,2] samples, const f8[sample_count] expected, const f8[6,sample_count] slopes, "
    "const f8[view_count,2] viewed, f8[n,6] postures, f8[n] found, f4[n,view_count] views)"
)


def view_candidates(
    gray: NDArray[np.uint8],
    xy: Values,
    sides: Values,
    postures: Values,
    samples: Values,
    template: Values,
    slopes: Values,
    viewed: Values,
) -> tuple[Values, Values, NDArray[np.float32]]:
    """Return candidates' postures (n, 6) after a few steps of alignment, correlations (n,), and views (n, m).

    A view has the levels of the softened image at the points `viewed` (m, 2), sides from the centre. `slopes` (6, k)
    say how levels at the samples, over their product with the template, tell the offset of the pattern: its shift and
    the (2, 2) matrix, by rows, that adds to its points. See `identification.correlation`.
    """
    better, found = np.array(postures, dtype=np.float64), np.empty(len(xy))
    views = np.empty((len(xy), len(viewed)), np.float32)
    _view_candidates(gray, xy, sides, samples, template, slopes, viewed, better, found, views)
    return better, found, views
