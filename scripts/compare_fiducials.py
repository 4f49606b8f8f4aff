"""Compare markers and arrays with ArUco and AprilTag: `python scripts/compare_fiducials.py --help`."""

from peakmark.cli.command import run_command
from peakmark.cli.fiducials_command import compare_fiducials

if __name__ == "__main__":
    run_command(compare_fiducials)
