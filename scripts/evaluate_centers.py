"""How exact round markers' centres are, and whether σ says so: `python scripts/evaluate_centers.py --help`."""

from peakmark.cli.command import run_command
from peakmark.cli.search import evaluate_centers

if __name__ == "__main__":
    run_command(evaluate_centers)
