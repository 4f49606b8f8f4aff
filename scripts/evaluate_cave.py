"""Score the reading of marker arrays on random rooms: `python scripts/evaluate_cave.py --help`."""

from peakmark.command import run_command
from peakmark.experiments.cave_evaluation_command import evaluate_cave

if __name__ == "__main__":
    run_command(evaluate_cave)
