"""Candidate faces and crowded pixels, against plain NumPy on hand-made images of numbers."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from peaksim.area.owner import MIXED
from peaksim.area.shown import CROWDED, MOST_FACES, SAMPLES, cut_crowded, list_in_pixels, list_in_tiles

OPAQUE = 255 << 24
NONE = np.zeros((1, 0), np.int64), np.zeros(1, np.int64)


def positions(height: int, width: int) -> np.ndarray:
    """Return (column, row, 1) of pixel corners where samples lie evenly."""
    x, y = np.meshgrid(SAMPLES * np.arange(width + 1.0), SAMPLES * np.arange(height + 1.0))
    return np.stack([x, y, np.ones_like(x)], axis=2)


def image(seed: int, faces: int, side: int = 8) -> np.ndarray:
    shown = np.random.default_rng(seed).integers(0, faces + 1, (side * SAMPLES, side * SAMPLES))
    return np.where(shown, shown + OPAQUE, 0).astype(np.uint32)


def shown_in(numbers: np.ndarray, y: int, x: int, height: int, width: int) -> set[int]:
    """Return the faces of the samples of a rectangle of pixels and of those around it."""
    rows = slice(max(SAMPLES * y - 1, 0), SAMPLES * (y + height) + 1)
    columns = slice(max(SAMPLES * x - 1, 0), SAMPLES * (x + width) + 1)
    return set((numbers[rows, columns] & 0xFFFFFF).ravel().tolist()) - {0}


@given(st.integers(0, 1000), st.integers(1, MOST_FACES))
def test_a_tile_lists_the_faces_of_its_samples_and_of_those_around(seed: int, faces: int) -> None:
    numbers, groups = image(seed, faces), np.full(faces, -1)
    found, counts = np.zeros((2, MOST_FACES + 1), np.int64), np.zeros(2, np.int64)
    boxes = np.array([[0.0, 8, 1, 12, 24, 1], [16, 0, 1, 32, 32, 1]])
    touching = np.zeros((2, 0), np.int64), np.zeros(2, np.int64)
    list_in_tiles(numbers, groups, *touching, boxes, found, counts)
    assert {k + 1 for k in found[0, : counts[0]].tolist()} == shown_in(numbers, 2, 0, 4, 3)
    assert {k + 1 for k in found[1, : counts[1]].tolist()} == shown_in(numbers, 0, 4, 8, 4)


def test_a_tile_lists_what_lies_on_a_face_that_is_shown() -> None:
    numbers = np.full((4, 4), 3 + OPAQUE, np.uint32)
    found, counts = np.zeros((1, MOST_FACES + 1), np.int64), np.zeros(1, np.int64)
    groups = np.array([0, 1, 0, -1, 0])
    touching = np.array([[0, 1, 2, 4]]), np.array([3])  # face 4 is not in this tile
    list_in_tiles(numbers, groups, *touching, np.array([[0.0, 0, 1, 4, 4, 1]]), found, counts)
    assert found[0, : counts[0]].tolist() == [2, 0]


def test_pixels_of_a_full_tile_have_lists_of_their_own_and_the_fullest_are_crowded() -> None:
    numbers = image(1, MOST_FACES)
    numbers[: 3 * SAMPLES] = np.arange(3 * SAMPLES * 8 * SAMPLES).reshape(3 * SAMPLES, -1) + 100 + OPAQUE
    full, cells = np.array([True]), np.zeros((8, 8), np.int64)
    found, counts = np.zeros((65, MOST_FACES + 1), np.int64), np.zeros(65, np.int64)
    alone = np.full(65, MIXED)
    groups = np.full(2000, -1)
    sides = np.zeros((1, 2000, 5, 3))
    list_in_pixels(
        numbers, groups, *NONE, positions(8, 8), positions(8, 8), sides, 16, full, found, counts, alone, cells
    )
    assert np.array_equal(cells, np.arange(1, 65).reshape(8, 8))
    assert (alone[cells][:3] == CROWDED).all()
    assert (alone[cells][4:] == MIXED).all()
    for y in range(4, 8):
        for x in range(8):
            cell = cells[y, x]
            assert {k + 1 for k in found[cell, : counts[cell]].tolist()} == shown_in(numbers, y, x, 1, 1)


def test_a_crowded_pixel_is_cut_into_equal_parts_with_the_face_at_their_middle() -> None:
    numbers = np.arange(SAMPLES * SAMPLES, dtype=np.uint32).reshape(SAMPLES, SAMPLES)  # nothing, then faces 0, 1, …
    corners = np.array([[[0.0, 0, 1], [1, 0, 1]], [[0, 1, 1], [1, 1, 1]]])
    sides = np.zeros((1, SAMPLES * SAMPLES, 5, 3))
    sides[0, :, 0, 0] = sides[0, :, 1, 1] = sides[0, :, 4, 2] = 1  # coordinates on a face are those in the pixel
    n = SAMPLES * SAMPLES
    polygons, pieces, shares = np.zeros((n, 24, 2)), np.zeros((n, 4), np.int64), np.zeros(n)
    out = np.zeros((1, 1, 1), np.float32)
    pixels = np.zeros((1, 2), np.int64)
    count = cut_crowded(
        corners, sides, numbers, positions(1, 1), pixels, np.full((1, 1, 1), 160.0), polygons, pieces, shares, out
    )
    assert count == n - 1
    assert out[0, 0, 0] == 160 / n
    assert np.all(shares[:count] == 1 / n)
    assert pieces[:count, 2].tolist() == list(range(n - 1))
    middles = polygons[:count, :4].mean(axis=1)
    expected = np.stack(np.meshgrid(np.arange(SAMPLES) + 0.5, np.arange(SAMPLES) + 0.5), axis=2).reshape(-1, 2)
    assert np.allclose(middles, expected[1:] / SAMPLES)
