"""Make an annotated image set: `python scripts/make_corpus.py --help`; the same as `peakmark corpus make`."""

from peakmark.cli.command import run_command
from peakmark.cli.corpus import make

if __name__ == "__main__":
    run_command(make)
