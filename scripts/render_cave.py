"""Render the SIFT/SURF CAVE, read its marker arrays and score them: `python scripts/render_cave.py --help`."""

from peakmark.cli.cave import render_cave
from peakmark.cli.command import run_command

if __name__ == "__main__":
    run_command(render_cave)
