"""Measure poses and whether their covariance is honest: `python scripts/evaluate_poses.py --help`."""

from peakmark.cli.command import run_command
from peakmark.cli.poses import evaluate_poses

if __name__ == "__main__":
    run_command(evaluate_poses)
