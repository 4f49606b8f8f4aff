"""Candidates found again are left out as a look at all pairs would; large images are searched twice."""

import numpy as np
import pytest

from peakmark.identification.candidates import SMALLEST_PX, candidate_pages, distinct_rows, joined
from peakmark.markers.patterns import surf_marker


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


@pytest.mark.parametrize(("height", "width"), [(1200, 2200), (1700, 1500)])
def test_large_images_are_searched_in_their_own_pixels_and_reduced(height: int, width: int) -> None:
    gray = np.full((height, width), 150, np.uint8)
    rng = np.random.default_rng(height)
    wanted = []
    for k, side in enumerate([16, 24, 33, 51, 90, 180, 333] * 2):
        marker = np.pad(surf_marker(side, "light" if k % 2 else "dark"), side // 9 + 1, constant_values=255)
        top = (k // 7) * height // 2 + int(rng.integers(height // 2 - len(marker)))
        left = (k % 7) * width // 7 + int(rng.integers(width // 7 - len(marker) + 1) if len(marker) < width // 7 else 0)
        part = gray[top : top + len(marker), left : left + len(marker)]
        part[:] = marker[: part.shape[0], : part.shape[1]]
        if part.shape == marker.shape and len(marker) < width // 7:
            wanted.append((left + (len(marker) - 1) / 2, top + (len(marker) - 1) / 2, side, -1 if k % 2 else 1))
    found = joined(list(candidate_pages(gray)))
    assert len(wanted) > 8
    for x, y, side, sign in wanted:
        gaps = np.linalg.norm(found.xy - [x, y], axis=1)
        rows = np.flatnonzero((gaps < 0.1 * side) & (found.signs == sign))
        assert np.abs(np.log(found.sides_px[rows] / side)).min(initial=9) < np.log(1.3)


def test_small_blobs_are_found_in_the_enlarged_image() -> None:
    gray = np.full((90, 120), 200, np.uint8)
    gray[40:48, 60:68] = surf_marker(72).reshape(8, 9, 8, 9).mean(axis=(1, 3))
    usual, smaller = (joined(list(candidate_pages(gray, side))) for side in (SMALLEST_PX, 6.0))
    assert not (np.linalg.norm(usual.xy - [63.5, 43.5], axis=1) < 0.5).any()
    assert (np.linalg.norm(smaller.xy - [63.5, 43.5], axis=1) < 0.5).any()
