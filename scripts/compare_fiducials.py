"""Compare markers and arrays with ArUco and AprilTag: `python scripts/compare_fiducials.py --help`."""

from peakmark.cli.cave import compare_fiducials
from peakmark.cli.command import run_command

if __name__ == "__main__":
    run_command(compare_fiducials)
