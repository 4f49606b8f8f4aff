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
        "print(*{'numba', 'cv2', 'scipy', 'matplotlib', 'pyrender'} & set(sys.modules))"
    )
    assert heavy == []
    assert float(seconds) < 0.3


def test_a_second_process_compiles_nothing() -> None:
    code = f"import numpy as np; from peakmark import surf; surf.detect_and_describe({SMALL})"
    run(code)
    counted = (
        "import numpy as np; from numba.core import event\n"
        "from peakmark import surf\n"
        f"with event.install_recorder('numba:compile') as compiled: surf.detect_and_describe({SMALL})\n"
        "print(len(compiled.buffer))"
    )
    assert run(counted) == ["0"]
