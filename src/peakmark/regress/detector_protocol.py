"""How to talk to a detector in another process: one line of JSON for each image, one for each answer.

To the program, on its standard input::

    {"frame": 12, "image": "/path/to/00000012.png", "width": 640, "height": 480}

From the program, on its standard output, before the time limit::

    {"frame": 12, "detections": [{"x": 310.2, "y": 88.0, "size": 24.0, "response": 8800.0, "polarity": "dark"}, …]}
    {"frame": 12, "keypoints": [{"x": 310.2, "y": 88.0, "size": 24.0, "response": 8800.0, "laplacian": 1}, …]}
    {"frame": 12, "error": "one line"}

`detections` are what the program takes for markers, `keypoints` all features, of which it does not say which are
markers; an answer may have both. x and y are in pixels with centres at integers; all other fields may be missing.
`polarity` is "light" or "dark", `laplacian` −1 for a light and +1 for a dark centre; whoever tells neither is not
charged with wrong ones. The image is a grey PNG and is deleted after the answer. The program ends when its input does;
it and all that it started are ended with the run.
"""

import json
from dataclasses import dataclass
from typing import Any, get_args

import numpy as np

from peakmark.errors import one_line
from peakmark.identification.detection import Detection
from peakmark.keypoints.keypoints import Keypoints
from peakmark.markers.patterns import Polarity

MOST_POINTS = 1_000_000
"""An answer with more is refused: that is a point in every third pixel of 2048×1536."""


LARGEST = float(np.finfo(np.float32).max)
"""Numbers beyond it are refused: as a column of `Keypoints` they would be infinite."""


class DetectorFailure(Exception):
    """A detector failed on one image; the message is one line, safe to print, and starts with the kind of failure."""

    def __init__(self, reason: str) -> None:
        super().__init__(one_line(reason))


@dataclass(frozen=True)
class Found:
    """What was found in one image."""

    features: Keypoints
    """All key points, strongest first; empty where the detector gives none."""
    detections: tuple[Detection, ...] | None
    """What is taken for a marker; None where the detector does not say."""


def request_line(frame: int, image: str, width: int, height: int) -> bytes:
    """Return the line that asks for an image."""
    return (json.dumps({"frame": frame, "image": image, "width": width, "height": height}) + "\n").encode()


def answer_line(frame: int, found: Found) -> bytes:
    """Return the line that answers a request."""
    kp = found.features
    columns = zip(kp.xy.tolist(), kp.size.tolist(), kp.response.tolist(), kp.laplacian.tolist(), strict=True)
    value: dict[str, Any] = {
        "frame": frame,
        "keypoints": [
            {"x": x, "y": y, "size": size, "response": response, "laplacian": sign}
            for (x, y), size, response, sign in columns
        ],
    }
    if found.detections is not None:
        value["detections"] = [
            {
                "x": float(d.xy[0]),
                "y": float(d.xy[1]),
                "size": float(d.size),
                "response": float(d.response),
                "polarity": d.polarity,
                "distance": float(d.signature_distance),
                "rank": int(d.rank),
            }
            for d in found.detections
        ]
    return (json.dumps(value) + "\n").encode()


def parse_answer(line: bytes, frame: int) -> Found:
    """Read an answer.

    Raises
    ------
    DetectorFailure
        "rubbish: …" if it is not one, "error: …" if it says that the program failed.
    """
    try:
        value = json.loads(line)
    except (ValueError, RecursionError) as error:
        raise DetectorFailure(f"rubbish: expected a line of JSON, got {_excerpt(line)}") from error
    is_answer = isinstance(value, dict) and value.get("frame") == frame and not isinstance(value["frame"], bool)
    if is_answer and isinstance(value.get("error"), str):
        raise DetectorFailure(f"error: {' '.join(value['error'].split())[:200]}")
    if not is_answer or not {"detections", "keypoints"} & value.keys():
        expected = f'{{"frame": {frame}, "detections" or "keypoints": […]}}'
        raise DetectorFailure(f"rubbish: expected {expected}, got {_excerpt(line)}")
    features = _features(_rows(value.get("keypoints", []), "keypoints"))
    if "detections" not in value:
        return Found(features, None)
    rows = sorted(_rows(value["detections"], "detections"), key=lambda row: -row["response"])
    return Found(features, tuple(_detection(i, row) for i, row in enumerate(rows)))


def _excerpt(line: bytes) -> str:
    return repr(line[:60].decode("utf-8", "replace"))


def _rows(value: Any, name: str) -> list[dict[str, Any]]:
    """Return points with x, y, size and response as finite numbers."""
    if not isinstance(value, list) or len(value) > MOST_POINTS:
        raise DetectorFailure(f"rubbish: {name}: expected a list of at most {MOST_POINTS} points")
    return [_row(point, name) for point in value]


def _row(point: Any, name: str) -> dict[str, Any]:
    if not isinstance(point, dict):
        raise DetectorFailure(f"rubbish: {name}: expected points with x and y, got {str(point)[:40]!r}")
    numbers = {"size": 0.0, "response": 0.0, "distance": 0.0, "rank": 0, "laplacian": 0, **point}
    for field in ("x", "y", "size", "response", "distance", "rank", "laplacian"):
        number = numbers.get(field)
        if isinstance(number, bool) or not isinstance(number, int | float) or number != number or abs(number) == np.inf:
            raise DetectorFailure(f"rubbish: {name}: {field}: expected a finite number, got {str(number)[:40]!r}")
        if abs(number) > LARGEST:
            raise DetectorFailure(
                f"rubbish: {name}: {field}: expected at most ±{LARGEST:.2g}, got {str(number)[:40]!r}"
            )
    if numbers["rank"] != int(numbers["rank"]):
        raise DetectorFailure(f"rubbish: {name}: rank: expected a whole number, got {numbers['rank']!r}")
    polarity = numbers.get("polarity")
    if polarity not in (None, *get_args(Polarity)):
        raise DetectorFailure(f"rubbish: {name}: polarity: expected light, dark or null, got {str(polarity)[:40]!r}")
    return numbers


def _features(rows: list[dict[str, Any]]) -> Keypoints:
    """Return key points, strongest first."""
    rows = sorted(rows, key=lambda row: -row["response"])
    size = np.array([row["size"] for row in rows], dtype=np.float32)
    none = np.zeros(len(rows))
    return Keypoints(
        xy=np.array([(row["x"], row["y"]) for row in rows], dtype=np.float32).reshape(-1, 2),
        size=size,
        angle=none - 1,  # type: ignore[arg-type]
        response=np.array([row["response"] for row in rows], dtype=np.float32),
        octave=none,  # type: ignore[arg-type]
        laplacian=np.array([np.sign(row["laplacian"]) for row in rows], dtype=np.int8),
        scale=size,
    )


def _detection(i: int, row: dict[str, Any]) -> Detection:
    return Detection(
        id=i,
        xy=np.array([row["x"], row["y"]], dtype=np.float64),
        size=float(row["size"]),
        polarity=row.get("polarity"),
        response=float(row["response"]),
        signature_distance=float(row["distance"]),
        rank=int(row["rank"]),
    )
