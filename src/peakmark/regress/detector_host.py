"""The process in which a user's function or a cv2.Feature2D runs: `-m peakmark.regress.detector_host NAME PARAMETERS`.

It writes "ready", or the reason why it cannot start, and then answers each request line of
`peakmark.regress.detector_protocol` with one line.
"""

import json
import os
import sys
from collections.abc import Callable, Iterable
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from peaksim.image_file import read_image

from peakmark.detectors.registry import as_keypoints, find_detector, import_function
from peakmark.errors import InputError
from peakmark.identification.detection import Detection
from peakmark.keypoints.keypoints import Keypoints
from peakmark.regress.detector_protocol import Found, answer_line

UserFunction = Callable[[NDArray[np.uint8]], Any]
"""Takes a (H, W) uint8 image and returns what `as_found` knows."""


def load(name: str, parameters: dict[str, Any]) -> UserFunction:
    """Return the function of an image behind "module:function" or "cv2:NAME"; both take parameters.

    Raises
    ------
    InputError
        If there is none.
    """
    if name.startswith("cv2:"):
        return partial(find_detector(name, describe=False), **parameters)
    return partial(import_function(name), **parameters)


def as_found(value: Any) -> Found:
    """Return what a user's function found.

    Parameters
    ----------
    value
        What the function takes for markers, as a list or tuple of `Detection`; or all its key points, as
        `peakmark.detectors.registry.as_keypoints` takes them; or both, as `Found`. A `Detection` whose polarity is
        None, and a key point whose Laplacian is 0, tells no polarity.

    Raises
    ------
    InputError
        If it is none of them, or holds nan or infinity.
    """
    if isinstance(value, Found):
        found = value
    elif isinstance(value, list | tuple) and value and all(isinstance(d, Detection) for d in value):
        found = Found(Keypoints.empty(), tuple(value))
    else:
        found = Found(as_keypoints(value), None)
    detections = found.detections or ()
    points = [*found.features.xy, *(d.xy for d in detections)]
    responses = [*found.features.response, *(d.response for d in detections)]
    if not (np.isfinite(np.array(points)).all() and np.isfinite(np.array(responses)).all()):
        raise InputError("expected finite positions and responses, got nan or infinity")
    return found


def serve(find: UserFunction, requests: Iterable[bytes], reply: Callable[[bytes], None]) -> None:
    """Answer requests until there are no more; what the function raises is an answer too."""
    for line in requests:
        request = json.loads(line)
        try:
            reply(answer_line(request["frame"], as_found(find(read_image(request["image"])))))
        except Exception as error:  # the user's code may raise anything
            reason = f"{type(error).__name__}: {' '.join(str(error).split())[:200]}"
            reply((json.dumps({"frame": request["frame"], "error": reason}) + "\n").encode())


def main(name: str, parameters: str = "{}") -> None:
    """Serve on standard input and output; what the user's code prints goes to standard error."""
    channel = os.fdopen(os.dup(1), "wb", buffering=0)
    os.dup2(2, 1)

    def reply(line: bytes) -> None:
        view = memoryview(line)
        while view:
            view = view[channel.write(view) :]

    try:
        find = load(name, json.loads(parameters))
    except Exception as error:  # importing the user's code may raise anything
        reply(f"{' '.join(str(error).split())[:300]}\n".encode())
        sys.exit(2)
    reply(b"ready\n")
    serve(find, sys.stdin.buffer, reply)


if __name__ == "__main__":
    main(*sys.argv[1:])
