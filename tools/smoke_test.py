"""What an installed copy must do, in an environment that holds nothing else: `python smoke_test.py FOLDER`.

The core alone: markers drawn by peakmark, found again in Python and by the commands; a quad drawn by the exact
renderer; what needs an extra says which. Writes into FOLDER and prints one line; any other end is a failure.
"""

import subprocess
import sys
from pathlib import Path

import numpy as np
from peaksim import Camera, Quad, Scene, Texture, render
from PIL import Image

import peakmark
from peakmark import marker, surf


def run(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run a command of the installed copy in a folder."""
    program = Path(sys.executable).with_name("peakmark")
    return subprocess.run([str(program), *arguments], cwd=folder, capture_output=True, text=True, check=False)


def main(folder: Path) -> None:
    """Do the jobs and check what comes."""
    folder.mkdir(parents=True, exist_ok=True)
    image = np.full((300, 400), 230, np.uint8)
    image[60:140, 60:140] = marker.surf_marker(80)
    image[150:230, 250:330] = marker.surf_marker(80, "light")
    found = peakmark.find(image)
    expected = {"dark": (99.5, 99.5), "light": (289.5, 189.5)}
    assert {m.polarity for m in found.markers} == set(expected), found
    for one in found.markers:
        assert one.polarity is not None
        assert np.abs(one.xy - expected[one.polarity]).max() < 0.05, one
    assert len(surf.detect_and_describe(image)) > 2

    quad = Quad("wall", Texture.from_array(np.full((4, 4), 200, np.uint8)), (2.0, 2.0), np.eye(4))
    pose = np.diag([1.0, -1.0, -1.0, 1.0])
    pose[2, 3] = 2.0
    frame = render(Scene((quad,)), Camera(64, 48, 60.0), pose, renderer="exact")
    assert int(np.asarray(frame.image)[24, 32].max()) == 200

    Image.fromarray(image).save(folder / "image.png")
    done = run(folder, "identify", "image.png", "--out", "found.csv")
    assert done.returncode == 0, done.stderr
    assert len((folder / "found.csv").read_text(encoding="utf-8").splitlines()) == 3
    assert run(folder, "marker", "array-5", "--out", "sheet").returncode == 0
    assert run(folder, "--version").stdout.strip() == f"peakmark {peakmark.__version__}"
    if "sim" not in sys.argv[2:]:
        without = run(folder, "floor", "--out", "out")
        assert (without.returncode, without.stderr.count("\n")) == (2, 1), without.stderr
        assert "pip install 'peakmark[sim]'" in without.stderr
    print(f"peakmark {peakmark.__version__}: markers, key points, rendering, sheets and commands work")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
