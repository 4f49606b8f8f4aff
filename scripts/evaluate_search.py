"""How far `identify(image)` reaches, one disturbance at a time: `python scripts/evaluate_search.py --help`."""

from peakmark.cli.command import run_command
from peakmark.cli.search import evaluate_search

if __name__ == "__main__":
    run_command(evaluate_search)
