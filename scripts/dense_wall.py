"""Count the feature points of dense walls and those that repeat: `python scripts/dense_wall.py --help`."""

from peakmark.cli.cave import dense_wall
from peakmark.cli.command import run_command

if __name__ == "__main__":
    run_command(dense_wall)
