"""Films that browsers play: H.264 in MP4, through PyAV."""

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, nullcontext
from fractions import Fraction
from pathlib import Path
from typing import TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray
from peaksim.extras import needs_extra

FRAMES_PER_SECOND, WIDTH_PX = 10, 1024
"""Of films whose images have no rate of their own, and of experiments' films; both are chosen for small files."""

RgbImage = NDArray[np.uint8]
Drawable = TypeVar("Drawable")


def filmed(
    views: Iterable[Drawable], draw: Callable[[Drawable], RgbImage], path: Path | None
) -> Iterator[tuple[Drawable, RgbImage]]:
    """Yield each view with its image; a `path` gets a film of the images."""
    with nullcontext() if path is None else film(path, FRAMES_PER_SECOND, WIDTH_PX) as append:
        for view in views:
            image = draw(view)
            if append is not None:
                append(image)
            yield view, image


@contextmanager
@needs_extra
def film(path: Path, frames_per_second: float, width_px: int) -> Iterator[Callable[[RgbImage], None]]:
    """Give a function that appends (H, W, 3) RGB images, scaled to `width_px`, to an MP4 file."""
    import av

    with av.open(str(path), "w", options={"movflags": "faststart"}) as container:
        stream = container.add_stream("libx264", rate=Fraction(frames_per_second).limit_denominator(1000))
        stream.pix_fmt = "yuv420p"
        stream.options = {"crf": "23", "preset": "veryfast"}

        def append(image: RgbImage) -> None:
            small = cv2.resize(image, _even_size(image, width_px), interpolation=cv2.INTER_AREA)
            if not stream.codec_context.is_open:
                stream.height, stream.width = small.shape[:2]
            container.mux(stream.encode(av.VideoFrame.from_ndarray(small, format="rgb24")))

        yield append
        container.mux(stream.encode())


def _even_size(image: RgbImage, width_px: int) -> tuple[int, int]:
    """Return (width, height) of an image scaled to a width; H.264 wants both even."""
    height = image.shape[0] * width_px / image.shape[1]
    return 2 * (width_px // 2), max(2, 2 * round(height / 2))
