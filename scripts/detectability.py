"""Redo the experiments of Section 4.1: `python scripts/detectability.py --help`."""

from peakmark.cli.command import run_command
from peakmark.cli.detectability import detectability

if __name__ == "__main__":
    run_command(detectability)
