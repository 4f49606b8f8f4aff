"""Runs Python with the kernels compiled under address and undefined-behaviour sanitizers."""

import os
import shutil
import subprocess
import sys

import pytest

from tests.places import ROOT, SOURCES

LIBRARY = ROOT / "build" / "native-sanitized"


def run_sanitized(arguments: list[str]) -> None:
    """Run Python with the sanitized library, and fail with what the sanitizers say; skip where gcc has none."""
    gcc = shutil.which("gcc")
    runtime = gcc and subprocess.run([gcc, "-print-file-name=libasan.so"], capture_output=True, text=True, check=True)
    if not runtime or not os.path.isabs(runtime.stdout.strip()):
        pytest.skip("no gcc with libasan")
    command = [sys.executable, "tools/build_native.py", "--sanitize", "--out", str(LIBRARY)]
    subprocess.run(command, cwd=ROOT, env={**os.environ, "CC": "gcc"}, check=True)
    environment = {
        **os.environ,
        "PEAKSIM_NATIVE": str(LIBRARY),
        "LD_PRELOAD": runtime.stdout.strip(),
        "ASAN_OPTIONS": "detect_leaks=0",  # Python keeps memory of its own until the end
        "PYTHONPATH": os.pathsep.join([SOURCES, str(ROOT)]),
    }
    done = subprocess.run(
        [sys.executable, *arguments], cwd=ROOT, env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, (done.stdout + done.stderr)[-4000:]
