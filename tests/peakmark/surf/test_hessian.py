"""The fused search against the plain operators, whatever the image, the mask and the cut into blocks."""

from unittest.mock import patch

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from peakmark.keypoints.keypoints import Keypoints
from peakmark.parallel import threads
from peakmark.surf import hessian as surf_hessian
from peakmark.surf.hessian import RECORD_FIELDS, find_interest_points, grid_blocks, strongest_first
from peakmark.surf.integral import integral_image, padded_integral
from peakmark.surf.layers import Layer
from tests.peakmark.surf.reference import hessian_responses, interest_points
from tests.samples import speckled


def search(
    gray: np.ndarray, threshold: float, octaves: int, layers: int, mask: np.ndarray | None = None
) -> dict[str, np.ndarray]:
    """Columns of the kernel's records, in OpenCV's order."""
    mask_sums = None if mask is None else padded_integral(mask.astype(np.uint8))
    records = find_interest_points(padded_integral(gray), gray.shape, threshold, octaves, layers, mask_sums)
    return dict(zip(RECORD_FIELDS, records[strongest_first(records)].T, strict=True))


def assert_same(found: dict[str, np.ndarray], plain: Keypoints) -> None:
    for name in ("size", "response", "octave", "laplacian"):
        np.testing.assert_array_equal(found[name], getattr(plain, name), err_msg=name)
    np.testing.assert_allclose(np.stack([found["x"], found["y"]], axis=1), plain.xy, atol=2e-3)
    np.testing.assert_allclose(found["scale"], plain.scale, atol=1e-2)


@given(
    height=st.integers(1, 150),
    width=st.integers(1, 150),
    seed=st.integers(0, 10**6),
    threshold=st.sampled_from([0.0, 1.0, 100.0, 3000.0]),
    octaves=st.integers(1, 5),
    layers=st.integers(1, 5),
    flat=st.booleans(),
)
def test_kernel_agrees_with_the_plain_operators(
    height: int, width: int, seed: int, threshold: float, octaves: int, layers: int, flat: bool
) -> None:
    gray = speckled(height, width, seed)
    if flat:  # a coarse quantisation makes ties and plateaus
        gray = gray // 64 * 64
    plain = interest_points(hessian_responses(integral_image(gray), octaves, layers), threshold)
    assert_same(search(gray, threshold, octaves, layers), plain)


@settings(max_examples=20)
@given(st.integers(1, 4), st.integers(5, 200), st.integers(0, 999))
def test_the_cut_into_blocks_changes_nothing(count: int, columns: int, seed: int) -> None:
    gray = speckled(140, 170, seed)
    expected = search(gray, 10.0, 3, 3)
    with threads(count), patch.object(surf_hessian, "BLOCK_COLUMNS", columns):
        found = search(gray, 10.0, 3, 3)
    assert len(expected["x"]) > 20
    for name in RECORD_FIELDS:
        assert found[name].tobytes() == expected[name].tobytes()


def test_blocks_tile_the_searched_positions_once() -> None:
    with threads(3):
        for octave in range(4):
            seen = np.zeros((2500 >> octave, 2100 >> octave), dtype=int)
            for block in grid_blocks((2500, 2100), octave, 3):
                seen[block.top : block.bottom, block.left : block.right] += 1
            margin = Layer(octave, 1).margin
            assert (seen[margin:-margin, margin:-margin] == 1).all()
            assert seen.sum() == seen[margin:-margin, margin:-margin].size


@pytest.mark.parametrize(
    "part", [(slice(None), slice(0, 80)), (slice(30, 90), slice(20, 140)), (slice(0, 0), slice(0))]
)
def test_the_mask_asks_for_half_of_the_filter_square(part: tuple[slice, slice]) -> None:
    gray = speckled(120, 160, 5)
    mask = np.zeros(gray.shape, dtype=bool)
    mask[part] = True
    everywhere, found = search(gray, 30.0, 3, 3), search(gray, 30.0, 3, 3, mask)
    layer_sides = {Layer(o, i).side: Layer(o, i) for o in range(3) for i in range(1, 4)}
    expected = []
    for k in range(len(everywhere["x"])):
        # the grid position is within half a step of layer and position of the refined maximum: try all that could be it
        accepted = {
            mask[y : y + side, x : x + side].mean() >= 0.5
            for side, layer in layer_sides.items()
            if layer.octave == everywhere["octave"][k] and abs(side - everywhere["scale"][k]) <= 6 * layer.step
            for y in grid_near(everywhere["y"][k], layer)
            for x in grid_near(everywhere["x"][k], layer)
        }
        expected.append(accepted)
    kept = set(zip(found["x"], found["y"], found["scale"], strict=True))
    sure = 0
    for k, accepted in enumerate(expected):
        if len(accepted) == 1:
            sure += 1
            record = (everywhere["x"][k], everywhere["y"][k], everywhere["scale"][k])
            assert (record in kept) == accepted.pop()
    assert sure > 0.6 * len(expected)
    assert kept <= set(zip(everywhere["x"], everywhere["y"], everywhere["scale"], strict=True))


def grid_near(center: float, layer: Layer) -> range:
    """Corners of the layer's filters whose centre is within one step of a refined coordinate."""
    corner = (center - (layer.side - 1) / 2) / layer.step
    return range(int(np.ceil(corner - 1)) * layer.step, int(np.floor(corner + 1)) * layer.step + 1, layer.step)


def test_ties_are_ordered_as_opencv_does() -> None:
    records = np.zeros((5, 7), dtype=np.float32)
    x, y, size, response, octave = 0, 1, 3, 4, 5
    records[:, response] = [7, 9, 7, 7, 7]
    records[:, size] = [20, 10, 20, 20, 25]
    records[:, octave] = [1, 0, 1, 1, 0]
    records[:, y] = [5, 0, 6, 6, 0]
    records[:, x] = [0, 0, 4, 3, 0]
    assert strongest_first(records).tolist() == [1, 4, 3, 2, 0]
    assert strongest_first(records[:0]).tolist() == []
