"""Measure finding markers over ten flights: `python scripts/evaluate_flights.py --help`."""

from peakmark.cli.command import run_command
from peakmark.cli.floor import evaluate_flights

if __name__ == "__main__":
    run_command(evaluate_flights)
