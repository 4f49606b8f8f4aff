"""Films for tests."""

from pathlib import Path

import av
import numpy as np

_QUARTERS = {0: (1, 0, 0, 1), 90: (0, 1, -1, 0), 180: (-1, 0, 0, -1), 270: (0, -1, 1, 0)}  # a, b, c, d of 14496-12


def write_film(path: Path, frames: list[np.ndarray], codec: str = "mpeg4") -> None:
    """Write grey frames of one size, ten a second, in the format of the path's ending."""
    with av.open(str(path), "w") as container:
        stream = container.add_stream(codec, rate=10)
        stream.width, stream.height, stream.pix_fmt = frames[0].shape[1], frames[0].shape[0], "yuv420p"
        for pixels in frames:
            container.mux(stream.encode(av.VideoFrame.from_ndarray(np.dstack([pixels] * 3), format="rgb24")))
        container.mux(stream.encode())


def rotate_mp4(path: Path, clockwise_deg: int) -> None:
    """Note in a film's track header that viewers shall rotate it, as phones do."""
    content = path.read_bytes()
    matrix = content.index(b"tkhd") + 44
    for offset, value in zip((0, 4, 12, 16), _QUARTERS[clockwise_deg], strict=True):
        number = (value * 65536).to_bytes(4, "big", signed=True)
        content = content[: matrix + offset] + number + content[matrix + offset + 4 :]
    path.write_bytes(content)
