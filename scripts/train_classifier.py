"""Train and judge the classifier of key points: `python scripts/train_classifier.py --help`."""

from peakmark.command import run_command
from peakmark.experiments.cave_training_command import train_classifier

if __name__ == "__main__":
    run_command(train_classifier)
