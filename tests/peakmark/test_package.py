"""What `import peakmark` costs, and what a second process needs before it detects."""

import os
import subprocess
import sys

from tests.places import SOURCES

SMALL = "np.eye(64, dtype=np.uint8) * 255"


def run(code: str) -> list[str]:
    done = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        check=True,
        timeout=300,
        env={**os.environ, "PYTHONPATH": SOURCES},
    )
    return done.stdout.split()


def test_importing_is_quick_and_loads_no_heavy_library() -> None:
    seconds, *heavy = run(
        "import sys, time; start = time.process_time(); import peakmark; print(time.process_time() - start);"
        "print(*{'numpy', 'cv2', 'scipy', 'matplotlib', 'pyrender'} & set(sys.modules))"
    )
    assert heavy == []
    assert float(seconds) < 0.3


def test_a_first_answer_is_quick() -> None:
    """Nothing is compiled: the first call may take a few times as long as the second, which takes about 10 ms."""
    seconds, *heavy = run(
        "import sys, time, numpy as np, peakmark\n"
        f"gray = {SMALL}\n"
        "start = time.process_time(); peakmark.identify(gray); print(time.process_time() - start)\n"
        "print(*{'scipy', 'matplotlib', 'pyrender'} & set(sys.modules))"
    )
    assert float(seconds) < 3
    assert heavy == []
