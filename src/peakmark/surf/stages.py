"""SURF's first stages by themselves: responses of whole layers, and their maxima; `detect` stores neither."""

from collections.abc import Sequence
from itertools import chain
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from peaksim.kernel import kernel

from peakmark.keypoints.keypoints import Keypoints
from peakmark.markers.patterns import DXY_WEIGHT
from peakmark.surf.exact import exact_derivatives, newton_offset, strongest_neighbour, write_record
from peakmark.surf.hessian import RECORD_FIELDS, strongest_first, to_keypoints
from peakmark.surf.layers import Layer, octave_layers

_DXY = np.float32(DXY_WEIGHT)


class LayerResponse(NamedTuple):
    """Determinant and trace of the Hessian of one layer, on its grid; zero where the filter leaves the image."""

    layer: Layer
    det: NDArray[np.float32]
    """(H // step, W // step) Dxx Dyy − 0.81 Dxy², (grey levels)²."""
    trace: NDArray[np.float32]
    """(H // step, W // step) Dxx + Dyy, grey levels; positive on dark blobs."""


def hessian_responses(integral: NDArray[np.int32], octaves: int = 4, layers: int = 3) -> list[LayerResponse]:
    """Responses of all `layers` + 2 layers of every octave, finest first.

    Parameters
    ----------
    integral : (H + 1, W + 1) int32 array, see `integral_image`.
    octaves, layers : number of octaves, and of layers per octave in which maxima are sought.
    """
    sums = np.ascontiguousarray(integral)
    every = chain.from_iterable(octave_layers(octave, layers) for octave in range(octaves))
    return [_layer_response(sums, layer) for layer in every]


def _layer_response(sums: NDArray[np.int32], layer: Layer) -> LayerResponse:
    height, width = sums.shape[0] - 1, sums.shape[1] - 1
    det = np.zeros(layer.grid_shape(height, width), dtype=np.float32)
    trace = np.zeros_like(det)
    rows, columns = layer.positions(height, width)
    inner = slice(layer.offset, layer.offset + rows), slice(layer.offset, layer.offset + columns)
    _respond(sums.reshape(-1), sums.shape[1], layer.step, layer.side, det[inner], trace[inner])
    return LayerResponse(layer, det, trace)


@kernel
def _respond(sums, stride, step, side, det, trace):
    """Fill both with the responses of filters a step apart, the first in the image's corner."""
    for i in range(det.shape[0]):
        for j in range(det.shape[1]):
            dxx, dyy, dxy = exact_derivatives(sums, stride, (i * stride + j) * step, side)
            det[i, j] = dxx * dyy - _DXY * dxy * dxy
            trace[i, j] = dxx + dyy


def interest_points(responses: Sequence[LayerResponse], threshold: float = 100.0) -> Keypoints:
    """Maxima of the responses over position and scale, refined, strongest first; their angles are −1.

    Parameters
    ----------
    responses : layers as `hessian_responses` returns them: whole octaves, finest first.
    threshold : a maximum must be larger, (grey levels)².

    Returns
    -------
    Keypoints
        Strict maxima among their 26 neighbours whose Newton step is not longer than one grid step along any axis.
    """
    found = [np.zeros((0, len(RECORD_FIELDS)), dtype=np.float32)]
    for below, here, above in zip(responses, responses[1:], responses[2:], strict=False):
        if below.layer.octave == above.layer.octave:
            cube, layer = np.stack([below.det, here.det, above.det]), here.layer
            maxima = np.argwhere(here.det > threshold)
            found.append(_refine(cube, here.trace, layer.octave, layer.index, layer.margin, maxima))
    records = np.concatenate(found)
    return to_keypoints(records[strongest_first(records)], np.float32(-1))


@kernel
def _refine(layers, trace, octave, index, margin, positions):
    """Records of those of (n, 2) grid positions of the middle layer that are maxima."""
    records, count = np.empty((len(positions), 7), dtype=np.float32), 0
    for k in range(len(positions)):
        i, j = positions[k]
        if margin <= i < trace.shape[0] - margin and margin <= j < trace.shape[1] - margin:
            cube = layers[:, i - 1 : i + 2, j - 1 : j + 2]
            ok, dx, dy, ds = newton_offset(cube)
            if ok and cube[1, 1, 1] > strongest_neighbour(cube):
                write_record(records[count], octave, index, i, j, cube[1, 1, 1], trace[i, j], (dx, dy, ds))
                count += 1
    return records[:count]
