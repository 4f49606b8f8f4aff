"""Score the reading of marker arrays on random rooms: `python scripts/evaluate_cave.py --help`."""

from peakmark.cli.cave import evaluate_cave
from peakmark.cli.command import run_command

if __name__ == "__main__":
    run_command(evaluate_cave)
