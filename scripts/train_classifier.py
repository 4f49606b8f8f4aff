"""Train and judge the classifier of key points: `python scripts/train_classifier.py --help`."""

from peakmark.cli.cave import train_classifier
from peakmark.cli.command import run_command

if __name__ == "__main__":
    run_command(train_classifier)
