"""A detector's CI on rendered fly-throughs: `python scripts/regress.py run|accept|compare --help`."""

from peakmark.cli_regress import app
from peakmark.command import run_command

if __name__ == "__main__":
    run_command(app)
