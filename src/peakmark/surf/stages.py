"""SURF's first stages by themselves: responses of whole layers, and their maxima; `detect` stores neither."""

from collections.abc import Sequence
from itertools import chain
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from peaksim.native import function

from peakmark.keypoints.keypoints import Keypoints
from peakmark.surf.hessian import RECORD_FIELDS, strongest_first, to_keypoints
from peakmark.surf.layers import Layer, octave_layers

_layer_responses = function(
    "void layer_responses(const i4[height,stride] integral, i8 step, i8 side, f4[rows,columns] det, "
    "f4[rows,columns] trace)"
)
_refine_maxima = function(
    "i8 refine_maxima(const f4[3,rows,columns] layers, const f4[rows,columns] trace, i8 octave, i8 index, i8 margin, "
    "const i8[n,2] positions, f4[n,7] records)"
)


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
    found = np.empty((2, rows, columns), dtype=np.float32)
    _layer_responses(sums, layer.step, layer.side, *found)
    inner = slice(layer.offset, layer.offset + rows), slice(layer.offset, layer.offset + columns)
    det[inner], trace[inner] = found
    return LayerResponse(layer, det, trace)


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
            kept = np.empty((len(maxima), len(RECORD_FIELDS)), dtype=np.float32)
            count = _refine_maxima(cube, here.trace, layer.octave, layer.index, layer.margin, maxima, kept)
            found.append(kept[:count])
    records = np.concatenate(found)
    return to_keypoints(records[strongest_first(records)], np.float32(-1))
