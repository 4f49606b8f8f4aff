"""Redo the experiments of Section 4.1: `python scripts/detectability.py --help`."""

from peakmark.command import run_command
from peakmark.experiments.detectability_command import detectability

if __name__ == "__main__":
    run_command(detectability)
