"""Train the screen of `identify(image)` and write its numbers: `python scripts/train_screen.py --help`."""

from peakmark.cli.command import run_command
from peakmark.cli.search import train_screen

if __name__ == "__main__":
    run_command(train_screen)
