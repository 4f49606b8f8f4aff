"""Measure calibrations beside OpenCV's boards: `python scripts/evaluate_calibration.py --help`."""

from peakmark.cli.calibrate import evaluate_calibration
from peakmark.cli.command import run_command

if __name__ == "__main__":
    run_command(evaluate_calibration)
