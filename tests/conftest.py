"""Settings of the whole suite."""

import os
import signal
import subprocess
import sys

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # its threads wait by spinning, which beside others takes minutes

import pytest
from hypothesis import is_hypothesis_test, settings
from hypothesis.internal.conjecture import providers

from tests.places import ROOT

# hundreds of processes would compile our files each time
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False

# examples come from a fixed seed, so that a run can be repeated; first calls import and compile, so no deadline
settings.register_profile("peakmark", deadline=None, derandomize=True, max_examples=50)
settings.register_profile("properties", deadline=None, derandomize=False, max_examples=500, print_blob=True)
settings.load_profile("peakmark")  # --hypothesis-profile=properties, which make test-properties gives, replaces it

# Hypothesis mixes in constants of the modules that a process happens to have imported: other examples in every run
if hasattr(providers, "_get_local_constants"):
    providers._get_local_constants = providers.Constants

# a shell that starts the suite in the background lets it, and what it starts, ignore Ctrl-C, which tests send
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark the tests whose examples Hypothesis draws, so that they are a suite of their own."""
    for item in items:
        if isinstance(item, pytest.Function) and is_hypothesis_test(item.obj):
            item.add_marker("properties")


def pytest_configure(config: pytest.Config) -> None:
    """Compile the kernels whose sources changed, so that no suite tests those of yesterday."""
    if not hasattr(config, "workerinput") and "PEAKSIM_NATIVE" not in os.environ:
        subprocess.run([sys.executable, "tools/build_native.py"], cwd=ROOT, check=True)
