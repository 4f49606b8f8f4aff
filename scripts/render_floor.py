"""Render the lab floor, find its markers and score them: `python scripts/render_floor.py --help`."""

from peakmark.command import run_command
from peakmark.experiments.floor_command import render_floor

if __name__ == "__main__":
    run_command(render_floor)
