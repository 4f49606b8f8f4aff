"""Peak memory of one detection in a process of its own: `python benchmarks/peak_memory.py LIBRARY PICTURE.npy`.

Prints two numbers, MB (10⁶ bytes) above an interpreter that holds the image: with the libraries that the detector
loads, and without them.
"""

import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray


def main(library: str, image: str) -> None:
    """Measure and print."""
    gray = np.load(image)
    bare = status_mb("VmRSS")
    detect = {"peakmark": load_ours, "opencv": load_opencv}[library]()
    detect(np.zeros((64, 64), dtype=np.uint8))
    loaded = status_mb("VmRSS")
    Path("/proc/self/clear_refs").write_text("5", encoding="ascii")  # the peak starts anew
    result = detect(gray)
    peak = status_mb("VmHWM")
    assert result is not None
    print(round(peak - bare, 1), round(peak - loaded, 1))


def load_ours() -> Callable[[NDArray[np.uint8]], object]:
    """Import and load the compiled kernels."""
    from peakmark import surf

    surf.describe(np.zeros((64, 64), np.uint8), surf.detect(np.eye(64, dtype=np.uint8) * 255))
    return surf.detect_and_describe


def load_opencv() -> Callable[[NDArray[np.uint8]], object]:
    """Import."""
    import cv2

    detector = cv2.xfeatures2d.SURF_create(100)  # type: ignore[attr-defined]
    return lambda gray: detector.detectAndCompute(gray, None)


def status_mb(field: str) -> float:
    """Return a size from this process's status, in 10⁶ bytes."""
    lines = Path("/proc/self/status").read_text(encoding="ascii").splitlines()
    return next(int(line.split()[1]) * 1024 / 1e6 for line in lines if line.startswith(field + ":"))


if __name__ == "__main__":
    main(*sys.argv[1:])
