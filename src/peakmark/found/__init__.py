"""What was found in an image, markers and arrays together: as values, rows, tables and files."""

from peakmark.found.found import Found, find
from peakmark.found.rows import FoundRow

__all__ = ["Found", "FoundRow", "find"]
