"""Candidates found again are left out as a look at all pairs would; copies are searched where the image is."""

import cv2
import numpy as np
import pytest

from peakmark.identification.candidates import DIRECTIONS_DEG, _spans, _warped, distinct_rows, squeeze
from peakmark.surf.hessian import find_interest_points
from peakmark.surf.integral import padded_integral


@pytest.mark.parametrize(("count", "height", "width"), [(0, 5, 5), (1, 1, 1), (900, 90, 120), (400, 3, 4000)])
def test_distinct_rows_are_those_of_a_look_at_all_pairs(count: int, height: int, width: int) -> None:
    rng = np.random.default_rng(count)
    xy, scales = rng.uniform(-0.5, [width - 0.5, height - 0.5], (count, 2)), 10 * np.exp(rng.uniform(0, 2, count))
    signs = rng.choice([-1.0, 1.0], count)
    expected: list[int] = []
    closer, ratio = 0.12, 1.2
    for i in range(count):
        near = [np.hypot(*(xy[k] - xy[i])) < closer * min(scales[k], scales[i]) for k in expected]
        like = [1 / ratio < scales[k] / scales[i] < ratio and signs[k] == signs[i] for k in expected]
        if not (np.array(near, bool) & np.array(like, bool)).any():
            expected.append(i)
    rows = np.column_stack([xy, scales, np.ones(count), signs, np.ones(count)])
    assert distinct_rows(rows, (height, width), closer, ratio).tolist() == expected


@pytest.mark.parametrize("angle_deg", [None, *DIRECTIONS_DEG])
@pytest.mark.parametrize(("height", "width"), [(90, 150), (333, 40), (130, 131)])
def test_what_lies_outside_the_image_is_not_searched_and_what_lies_inside_is(
    angle_deg: float | None, height: int, width: int
) -> None:
    gray = np.random.default_rng(height).integers(0, 256, (height // 3 + 1, width // 3 + 1), dtype=np.uint8)
    gray = cv2.resize(gray, (width, height), interpolation=cv2.INTER_CUBIC)
    pad = 11
    padded = cv2.copyMakeBorder(gray, pad, pad, pad, pad, cv2.BORDER_REPLICATE)
    matrix = np.eye(2) if angle_deg is None else squeeze(angle_deg)
    copy, shift = _warped(padded, matrix)
    inverse = np.linalg.inv(matrix)
    spans = _spans(copy.shape, inverse, -(inverse @ shift) - pad, gray.shape)
    everywhere, narrowed = (
        find_interest_points(padded_integral(copy), copy.shape, 100.0, 3, 3, None, each) for each in (None, spans)
    )
    xy = (everywhere[:, :2] - shift) @ inverse.T - pad
    inside = everywhere[((xy > -0.5) & (xy < np.array([width, height]) - 0.5)).all(axis=1)]
    assert 20 < len(inside) <= len(everywhere)
    assert {tuple(row) for row in inside.tolist()} <= {tuple(row) for row in narrowed.tolist()}
    if angle_deg in (45.0, 135.0) and height > 100:
        assert len(narrowed) < len(everywhere)
