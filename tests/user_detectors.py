"""Detectors as users might bring them, good and bad: run as `module:function` in a process of their own."""

import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from peakmark.identification.api import LOW_THRESHOLD
from peakmark.identification.detection import Detection
from peakmark.keypoints.keypoints import Keypoints
from peakmark.regress.detector import DetectorSettings, built_in_detector
from peakmark.regress.detector_protocol import Found


def brightest(gray: NDArray[np.uint8], size: float = 5.0) -> list[cv2.KeyPoint]:
    """Find the brightest pixel."""
    y, x = np.unravel_index(np.argmax(gray), gray.shape)
    return [cv2.KeyPoint(float(x), float(y), size, -1.0, float(gray[y, x]))]


def detection(gray: NDArray[np.uint8]) -> tuple[Detection, ...]:
    """Take the brightest pixel for a marker."""
    y, x = np.unravel_index(np.argmax(gray), gray.shape)
    return (Detection(0, np.array([x, y], float), 5.0, "light", 7.5, 0.25, 3),)


def detection_list(gray: NDArray[np.uint8]) -> list[Detection]:
    return list(detection(gray))


def of_numpys_numbers(gray: NDArray[np.uint8]) -> Any:
    (found,) = detection(gray)
    numbers = {"size": np.float32(5), "response": np.float64(7.5), "rank": np.int64(3)}
    return [replace(found, xy=[33, 11], **numbers)]  # type: ignore[arg-type]


def without_polarity(gray: NDArray[np.uint8]) -> list[Detection]:
    return [replace(found, polarity=None) for found in detection(gray)]


def detection_or_nothing(gray: NDArray[np.uint8]) -> list[Detection]:
    """Take the brightest pixel for a marker, on some images."""
    return list(detection(gray)) if int(gray.sum()) % 2 else []


def array_of_points(gray: NDArray[np.uint8]) -> NDArray[np.float64]:
    return np.array([brightest(gray)[0].pt])


def no_points(gray: NDArray[np.uint8]) -> NDArray[np.float64]:
    return np.array([])


def list_of_pairs(gray: NDArray[np.uint8]) -> list[tuple[float, float]]:
    return [brightest(gray)[0].pt, (3.0, 4.0)]


def in_turn(gray: NDArray[np.uint8], functions: list[str]) -> Any:
    """Return what the next of some functions finds."""
    _turns.append(functions[len(_turns)])
    return globals()[_turns[-1]](gray)


_turns: list[str] = []


def described(gray: NDArray[np.uint8]) -> tuple[list[cv2.KeyPoint], NDArray[np.float32]]:
    return brightest(gray), np.zeros((1, 64), np.float32)


def as_opencvs_surf(gray: NDArray[np.uint8]) -> list[cv2.KeyPoint]:
    """Tell polarity by the class id, as OpenCV's SURF does."""
    return [cv2.KeyPoint(1.0, 2.0, 5.0, -1.0, 9.0, 0, 1), cv2.KeyPoint(3.0, 4.0, 5.0, -1.0, 8.0, 0, -1)]


def our_key_points(gray: NDArray[np.uint8]) -> Keypoints:
    found = Keypoints.from_opencv(brightest(gray))
    return found.with_columns(laplacian=np.full(len(found), -1))


def chatty(gray: NDArray[np.uint8]) -> list[cv2.KeyPoint]:
    """Print while working, as much user code does."""
    print('{"frame": 0, "keypoints": []}')
    return brightest(gray)


def process_id(gray: NDArray[np.uint8]) -> list[cv2.KeyPoint]:
    """Tell as the response in which process this runs."""
    return [cv2.KeyPoint(0.0, 0.0, 1.0, -1.0, float(os.getpid()))]


def hangs_on_dark(gray: NDArray[np.uint8]) -> list[cv2.KeyPoint]:
    if gray.max() < 10:
        time.sleep(1000)
    return brightest(gray)


def dies_on_dark(gray: NDArray[np.uint8]) -> list[cv2.KeyPoint]:
    if gray.max() < 10:
        print("out of luck", file=sys.stderr, flush=True)
        os._exit(7)
    return brightest(gray)


def raises_on_dark(gray: NDArray[np.uint8]) -> list[cv2.KeyPoint]:
    if gray.max() < 10:
        raise ZeroDivisionError("too dark\nto see")
    return brightest(gray)


def nan_on_dark(gray: NDArray[np.uint8]) -> Any:
    if gray.max() < 10:
        return [cv2.KeyPoint(float("nan"), 1.0, 1.0)]
    return brightest(gray)


def wrong_type(gray: NDArray[np.uint8]) -> Any:
    return {"x": 1}


def wrong_shape(gray: NDArray[np.uint8]) -> Any:
    return np.zeros((4, 3))


def always_nan(gray: NDArray[np.uint8]) -> Any:
    return [cv2.KeyPoint(float("nan"), 1.0, 1.0)]


def always_dies(gray: NDArray[np.uint8]) -> Any:
    os._exit(7)


def fails_on_every_third(gray: NDArray[np.uint8]) -> list[cv2.KeyPoint]:
    """Fail on every third image, by its content."""
    if int(gray.sum()) % 3 == 1:
        raise RuntimeError("not today")
    return brightest(gray)


STUBBORN = "import signal, time; [signal.signal(n, signal.SIG_IGN) for n in (1, 2, 15)]; time.sleep(300)"


def stubborn(gray: NDArray[np.uint8]) -> list[cv2.KeyPoint]:
    """Hang with two children, one of them in a session of its own; all ignore what they are asked."""
    for number in (signal.SIGHUP, signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)
    for is_apart in (True, False):
        subprocess.Popen([sys.executable, "-c", STUBBORN], start_new_session=is_apart)
    Path(os.environ["PEAKMARK_TEST_READY"]).touch()
    while True:
        time.sleep(60)


def hangs(gray: NDArray[np.uint8]) -> list[cv2.KeyPoint]:
    time.sleep(1000)
    return []


def deletes(gray: NDArray[np.uint8]) -> list[cv2.KeyPoint]:
    """Delete its image, as a program that reads from a spool may do, and the folder of it."""
    (folder,) = Path(tempfile.gettempdir()).glob("peakmark-*")
    shutil.rmtree(folder)
    return brightest(gray)


def everything(gray: NDArray[np.uint8]) -> Found:
    """Return features and detections together."""
    return Found(Keypoints.from_opencv(brightest(gray)), detection(gray))


# --- planted faults: our own detector with one fault ---------------------------------------------------------


def markers(gray: NDArray[np.uint8], **parameters: Any) -> Found:
    """Find markers as the suite of the floor does."""
    return built_in_detector(DetectorSettings(stretch=1.5, parameters=parameters))(gray)


def shifted(found: Found) -> Found:
    """Take pixel corners for centres, along x."""
    moved = tuple(replace(d, xy=np.add(d.xy, (0.5, 0.0))) for d in found.detections or ())
    return Found(found.features.with_columns(xy=found.features.xy + np.float32([0.5, 0])), moved)


def swapped(found: Found) -> Found:
    """Take light for dark, as the sign of OpenCV's class_id invites one to."""
    return Found(
        found.features,
        tuple(replace(d, polarity="light" if d.polarity == "dark" else "dark") for d in found.detections or ()),
    )


FAULTS = ("threshold × 2", "one octave missing", "half a pixel", "polarity swapped")


def with_faults(gray: NDArray[np.uint8]) -> dict[str, Found]:
    """Return what the sound detector finds, under "sound", and what each faulty one finds."""
    sound = markers(gray)
    faulty = (markers(gray, threshold=2 * LOW_THRESHOLD), markers(gray, octaves=3), shifted(sound), swapped(sound))
    return {"sound": sound, **dict(zip(FAULTS, faulty, strict=True))}


def half_pixel_shift(gray: NDArray[np.uint8]) -> Found:
    return shifted(markers(gray))


def polarity_swapped(gray: NDArray[np.uint8]) -> Found:
    return swapped(markers(gray))
