"""`python -m peakmark.cli`: the same as `peakmark`."""

from peakmark.cli.app import main

main()
