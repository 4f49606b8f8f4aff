"""Train the decision of `identify(image)` and write its numbers: `python scripts/train_search.py --help`."""

from peakmark.cli.command import run_command
from peakmark.cli.search import train_search

if __name__ == "__main__":
    run_command(train_search)
