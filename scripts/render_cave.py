"""Render the SIFT/SURF CAVE, read its marker arrays and score them: `python scripts/render_cave.py --help`."""

from peakmark.command import run_command
from peakmark.experiments.cave_command import render_cave

if __name__ == "__main__":
    run_command(render_cave)
