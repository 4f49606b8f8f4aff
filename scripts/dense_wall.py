"""Count the feature points of dense walls and those that repeat: `python scripts/dense_wall.py --help`."""

from peakmark.cli.command import run_command
from peakmark.cli.dense_wall_command import dense_wall

if __name__ == "__main__":
    run_command(dense_wall)
