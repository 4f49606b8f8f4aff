"""A detector's CI on rendered fly-throughs: `python scripts/regress.py run|accept|compare --help`."""

from peakmark.cli.command import run_command
from peakmark.cli.regress import app

if __name__ == "__main__":
    run_command(app)
