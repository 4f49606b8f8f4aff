"""What the user is told beside results: one line on stderr, once a process."""

import sys
from functools import cache


@cache
def notice_once(message: str) -> None:
    """Print a line that tells what was done otherwise than asked."""
    print(f"peaksim: {message}", file=sys.stderr)
