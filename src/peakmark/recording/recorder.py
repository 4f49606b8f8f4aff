"""Recordings by the ending of their file."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from peaksim.whole_file import whole_file

from peakmark.errors import InputError
from peakmark.maps.marker_map import MarkerMap
from peakmark.recording.mcap_file import write_mcap
from peakmark.recording.moment import Moment
from peakmark.recording.rerun_file import write_rerun

_WRITERS = {".mcap": write_mcap, ".rrd": write_rerun}

ENDINGS = tuple(_WRITERS)
"""Of MCAP (Foxglove, ROS 2) and Rerun."""


def check_recording(path: Path) -> None:
    """Refuse a recording by its ending."""
    if path.suffix not in ENDINGS:
        raise InputError(f"--record {path}: expected a name ending in {' or '.join(ENDINGS)}")


@contextmanager
def recorder(path: Path, marker_map: MarkerMap | None = None) -> Iterator[Callable[[Moment], None]]:
    """Give a function that appends moments to a recording, which appears whole when the block ends.

    A `marker_map` is drawn in the world once. MCAP needs the extra `ros`, Rerun the extra `rerun`.

    Raises
    ------
    InputError
        If the name has another ending, or cannot be written.
    """
    check_recording(path)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with whole_file(path) as unfinished, _WRITERS[path.suffix](unfinished, marker_map) as append:
            yield append
    except OSError as error:
        raise InputError(f"--record {path}: cannot be written: {error.strerror or error}") from error
