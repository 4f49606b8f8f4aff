"""Films decode to the images that went in."""

from pathlib import Path

import av
import numpy as np

from peakmark.report.film import film


def test_images_come_back_in_order_scaled_and_in_colour(tmp_path: Path) -> None:
    colours = [(200, 30, 30), (30, 200, 30), (30, 30, 200)]
    with film(tmp_path / "f.mp4", 5, 65) as append:
        for colour in colours:
            append(np.full((100, 130, 3), colour, np.uint8))
    with av.open(str(tmp_path / "f.mp4")) as container:
        frames = [frame.to_ndarray(format="rgb24") for frame in container.decode(video=0)]
        assert container.streams.video[0].average_rate == 5
    assert [frame.shape for frame in frames] == [(50, 64, 3)] * 3
    for frame, colour in zip(frames, colours, strict=True):
        assert np.abs(frame.reshape(-1, 3).mean(axis=0) - colour).max() < 8
