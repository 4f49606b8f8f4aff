"""Compare markers and arrays with tags, rings and corners: `python scripts/compare_designs.py --help`."""

from peakmark.cli.command import run_command
from peakmark.cli.compare import compare_designs

if __name__ == "__main__":
    run_command(compare_designs)
