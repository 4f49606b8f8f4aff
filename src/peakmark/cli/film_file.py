"""Reading films from outside: upright as viewers show them.

Where the file ends before the film does, the whole frames that are left come first, then the error.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray
from peaksim.extras import needs_extra
from peaksim.image_file import MAX_PIXELS

from peakmark.errors import ImageError

ENDINGS = (".mp4", ".avi", ".mov", ".mkv", ".webm", ".m4v", ".mpg", ".mpeg")
"""Name endings that count as films."""

_SHORTEST_SHARE = 0.9
"""Of the duration that a film states: containers round it and may end on empty frames, but not for a tenth of it."""


def read_film(path: Path, is_upright: bool = True) -> Iterator[NDArray[np.uint8]]:
    """Yield the frames of `read_timed_film` without their times."""
    return (pixels for _, pixels in read_timed_film(path, is_upright))


@needs_extra
def read_timed_film(path: Path, is_upright: bool = True) -> Iterator[tuple[float, NDArray[np.uint8]]]:
    """Yield the frames of a film's first video stream: seconds from the first one, and (H, W, 3) RGB.

    The rotation that the film notes for viewers is applied unless `is_upright` is False, as `cv2.VideoCapture` does.

    Raises
    ------
    ImageError
        If the file is missing, no film, has no frame, or its frames exceed `MAX_PIXELS`; after the frames that can be
        read, if it is cut or damaged.
    """
    import av

    cut = None
    try:
        cut = _where_cut(path)
        with av.open(str(path)) as container:
            if not container.streams.video:
                raise ImageError("found no video stream")
            yield from _decode(container, is_upright, cut)
    except ImageError as error:
        raise ImageError(f"{path}: expected a film, {error}") from error
    except (OSError, ValueError, av.error.FFmpegError) as error:
        reason = f": {getattr(error, 'strerror', None) or error}" if cut is None else f", {cut}"
        raise ImageError(f"{path}: expected a film{reason}") from error


@needs_extra
def frames_per_second(path: Path) -> float:
    """Return the rate that a film states; 25 where it states none, and for what is no film, such as a camera."""
    import av

    try:
        with av.open(str(path)) as container:
            return float(container.streams.video[0].average_rate or 25)
    except (OSError, ValueError, IndexError, av.error.FFmpegError):
        return 25.0


def _decode(container: Any, is_upright: bool, cut: str | None) -> Iterator[tuple[float, NDArray[np.uint8]]]:
    """Yield the frames; then raise if the film is `cut`, which says where, or ends before it says that it does."""
    stream = container.streams.video[0]
    step_s, first_s, shown_s = 1 / float(stream.average_rate or 25), None, 0.0
    for count, frame in enumerate(_whole_frames(container, stream, cut is not None)):
        if frame.width * frame.height > MAX_PIXELS:
            raise ImageError(f"of at most {MAX_PIXELS} pixels, got {frame.width}×{frame.height}")
        time_s = count * step_s if frame.time is None else frame.time
        first_s = time_s if first_s is None else first_s
        shown_s = time_s - first_s + step_s
        pixels = frame.to_ndarray(format="rgb24")
        upright = np.ascontiguousarray(np.rot90(pixels, round(frame.rotation / 90))) if is_upright else pixels
        yield time_s - first_s, upright
    if first_s is None:
        raise ImageError(cut or "found no frame")
    stated_s = _stated_s(container, stream)
    states = "" if stated_s is None else f"it states {stated_s:.3g} s, and "
    if cut is not None:
        raise ImageError(f"{cut}: {states}its frames end after {shown_s:.3g} s")
    if stated_s is not None and shown_s < min(_SHORTEST_SHARE * stated_s, stated_s - 1.5 * step_s):
        raise ImageError(f"damaged: {states}its frames end after {shown_s:.3g} s")


def _whole_frames(container: Any, stream: Any, is_cut: bool) -> Iterator[Any]:
    """Yield a stream's frames, of a cut file without what its last, incomplete packet would give."""
    for packet in container.demux(stream):
        if not (is_cut and packet.is_corrupt):
            yield from packet.decode()


def _stated_s(container: Any, stream: Any) -> float | None:
    """Return how long the container says that the stream is, where it does; an audio stream may be longer."""
    if stream.duration is not None:
        return float(stream.duration * stream.time_base)
    if container.duration is not None and len(container.streams) == 1:
        return float(container.duration) / 1e6
    return None


# --- cut files ------------------------------------------------------------------------------------------------


def _where_cut(path: Path) -> str | None:
    """Return where a file is cut that ends before its outermost chunks do; None for others.

    FFmpeg decodes what is left of a cut file and reports no error.
    """
    size = path.stat().st_size
    with path.open("rb") as file:
        head = file.read(12)
        file.seek(0)
        if head[:4] == b"RIFF":
            end = _riff_end(file, size)
        elif head[:4] == b"\x1a\x45\xdf\xa3":
            end = _matroska_end(file)
        elif head[4:8] in (b"ftyp", b"moov", b"mdat", b"wide", b"free", b"skip"):
            end = _boxes_end(file, size)
        else:
            end = None
    return f"cut: expected {end} bytes, got {size}" if end is not None and end > size else None


def _riff_end(file: BinaryIO, size: int) -> int | None:
    """Return where the chunks of an AVI end (it has several from 1 GB on); None where the writer left that open."""
    at = 0
    while at + 8 <= size:
        file.seek(at)
        head = file.read(8)
        length = int.from_bytes(head[4:], "little")
        if head[:4] != b"RIFF":
            return at
        if length in (0, 0xFFFFFFFF):
            return None
        at += 8 + length + length % 2
    return at - 1 if at == size + 1 else at  # the last chunk's padding may be missing


def _boxes_end(file: BinaryIO, size: int) -> int | None:
    """Return where the boxes of MP4 and QuickTime end (ISO/IEC 14496-12, 4.2); None where the last has no length."""
    at = 0
    while at + 8 <= size:
        file.seek(at)
        head = file.read(16)
        length = int.from_bytes(head[:4], "big")
        if length == 1:
            length = int.from_bytes(head[8:], "big")
        if length < 8:
            return None
        at += length
    return at


def _matroska_end(file: BinaryIO) -> int | None:
    """Return where the segment of Matroska and WebM ends (RFC 8794); None where its length is unknown."""
    file.seek(4)
    header = _ebml_length(file)
    if header is None:
        return None
    file.seek(header, 1)
    if file.read(4) != b"\x18\x53\x80\x67":
        return None
    length = _ebml_length(file)
    return None if length is None else file.tell() + length


def _ebml_length(file: BinaryIO) -> int | None:
    """Read a variable-size integer; None where all its bits are set, which means unknown."""
    first = file.read(1)
    if not first or not first[0]:
        return None
    width = 9 - first[0].bit_length()
    value = int.from_bytes(first + file.read(width - 1), "big") & ((1 << 7 * width) - 1)
    return None if value == (1 << 7 * width) - 1 else value
