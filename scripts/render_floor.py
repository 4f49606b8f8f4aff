"""Render the lab floor, find its markers and score them: `python scripts/render_floor.py --help`."""

from peakmark.cli.command import run_command
from peakmark.cli.floor import render_floor

if __name__ == "__main__":
    run_command(render_floor)
