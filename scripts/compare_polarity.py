"""Tell dark from light markers by Laplacian and by signature: `python scripts/compare_polarity.py --help`."""

from peakmark.cli.cave import compare_polarity
from peakmark.cli.command import run_command

if __name__ == "__main__":
    run_command(compare_polarity)
