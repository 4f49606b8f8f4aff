"""Score `identify` and its peers on a folder of images: `python scripts/evaluate_images.py --help`."""

from peakmark.cli.command import run_command
from peakmark.cli.images import evaluate_images

if __name__ == "__main__":
    run_command(evaluate_images)
