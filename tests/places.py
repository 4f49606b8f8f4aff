"""Where tests find the checkout, its sources and the golden files."""

import os
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
GOLDEN = ROOT / "tests" / "golden"
SOURCES = os.pathsep.join(str(ROOT / folder) for folder in ("src", "sim"))
"""PYTHONPATH of a child process that runs this checkout."""
