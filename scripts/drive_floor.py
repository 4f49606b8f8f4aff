"""Let a robot follow lines of floor markers by sight, and score it: `python scripts/drive_floor.py --help`."""

from peakmark.cli.command import run_command
from peakmark.cli.floor import drive_floor

if __name__ == "__main__":
    run_command(drive_floor)
