"""Make an annotated image set: `python scripts/make_corpus.py --help`; the same as `peakmark corpus make`."""

from peakmark.cli_corpus import make
from peakmark.command import run_command

if __name__ == "__main__":
    run_command(make)
