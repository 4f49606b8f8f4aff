"""Geometry of the scale space: sides, margins and boxes."""

import pytest

from peakmark.surf.layers import Layer, octave_layers
from tests.peakmark.surf.reference import second_derivative_boxes

LAYERS = [layer for octave in range(5) for layer in octave_layers(octave, 4)]


def test_sides_are_bays() -> None:
    assert [layer.side for layer in octave_layers(0, 3)] == [9, 15, 21, 27, 33]
    assert [layer.side for layer in octave_layers(3, 2)] == [72, 120, 168, 216]


@pytest.mark.parametrize("layer", LAYERS, ids=str)
def test_offset_and_margin_are_opencvs_integer_divisions(layer: Layer) -> None:
    assert layer.offset == (layer.side // 2) // layer.step
    above = Layer(layer.octave, layer.index + 1)
    assert layer.margin == (above.side // 2) // layer.step + 1


@pytest.mark.parametrize("layer", LAYERS, ids=str)
def test_the_filters_of_a_layer_fill_its_grid_between_the_offsets(layer: Layer) -> None:
    for length in range(layer.side, layer.side + 3 * layer.step):
        rows, columns = layer.positions(length, length)
        assert rows == columns == layer.grid_shape(length, length)[0] - 2 * layer.offset
        assert (rows - 1) * layer.step + layer.side <= length < rows * layer.step + layer.side


def test_a_filter_that_does_not_fit_has_no_position() -> None:
    assert Layer(0, 0).positions(8, 100) == Layer(0, 0).positions(100, 8) == (0, 0)
    assert Layer(0, 0).positions(9, 9) == (1, 1)


@pytest.mark.parametrize("side", sorted({layer.side for layer in LAYERS}))
def test_boxes_balance_and_lie_inside(side: int) -> None:
    for boxes in second_derivative_boxes(side):
        assert sum(box.weight for box in boxes) == 0
        assert len({box.area for box in boxes}) == 1
        assert all(0 <= box.x0 < box.x1 <= side and 0 <= box.y0 < box.y1 <= side for box in boxes)
    dxx, dyy, _ = second_derivative_boxes(side)
    assert [(b.y0, b.x0, b.y1, b.x1) for b in dyy] == [(b.x0, b.y0, b.x1, b.y1) for b in dxx]
