"""SURF's marker, SIFT's and the disc side by side: `python scripts/compare_kinds.py --help`."""

from peakmark.cli.command import run_command
from peakmark.cli.search import compare_kinds

if __name__ == "__main__":
    run_command(compare_kinds)
