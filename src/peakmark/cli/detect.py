"""`peakmark detect`: key points of images, folders and films."""

from pathlib import Path
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from peaksim.image_file import read_image
from typer import Argument, Exit, Option

from peakmark.cli.command import examples, print_error
from peakmark.cli.detect_files import DetectedFile, detect_files
from peakmark.cli.options import Quiet, UnusedSeed, given
from peakmark.cli.sources import FailedFile
from peakmark.errors import one_line


@examples(
    "peakmark detect image.png --out keypoints.npz",
    "peakmark detect folder --detector sift --strongest 500 --overlay --out out/detect",
)
def detect(
    source: Annotated[Path, Argument(help="An image (PNG, JPEG, TIFF, …), a folder of images, or a film.")],
    out: Annotated[Path, Option(help="Folder, or for one image FILE.npz, .csv or .json.")] = Path("out/detect"),
    detector: Annotated[str, Option(help="surf, surf-paper, sift, cv2:ORB, module:function, … (see README).")] = "surf",
    threshold: Annotated[float | None, Option(help="Smallest response. [default: 100 for SURF]")] = None,
    octaves: Annotated[int | None, Option(help="Octaves. [default: 4]")] = None,
    layers: Annotated[int | None, Option(help="Searched layers an octave. [default: 3]")] = None,
    extended: Annotated[bool, Option("--extended", help="Descriptors of 128 entries.")] = False,
    upright: Annotated[bool, Option("--upright", help="Do not measure the orientation.")] = False,
    strongest: Annotated[int | None, Option(help="Keep only so many key points.")] = None,
    mask: Annotated[Path | None, Option(help="Image, nonzero where key points may be.")] = None,
    overlay: Annotated[bool, Option("--overlay", help="Also draw the key points, into NAME.overlay.png.")] = False,
    raw_orientation: Annotated[
        bool, Option("--raw-orientation", help="Pixels as the sensor read them out, not rotated as viewers show them.")
    ] = False,
    format: Annotated[str, Option(help="Of the files in a folder: npz, csv or json.")] = "npz",
    seed: UnusedSeed = 0,
    quiet: Quiet = False,
) -> None:
    """Detect and describe key points in images, folders and films.

    Images come upright, as viewers show them. An image of a folder that cannot be read is named and left out, and the
    exit status is then 1; result.json lists what was done and what failed.
    """

    def report(one: DetectedFile) -> None:
        if not quiet:
            what = f"{one.keypoints} key points in {one.width}×{one.height} px"
            print(f"{one_line(one.name)}: {what} → {one_line(one.file)}")

    failures: list[FailedFile] = []

    def fail(one: FailedFile) -> None:
        failures.append(one)
        print_error(one.reason)

    numbers = given(threshold=threshold, octaves=octaves, layers=layers, strongest=strongest)
    parameters = numbers | given(
        extended=extended, upright=upright, mask=None if mask is None else read_mask(mask, not raw_orientation)
    )
    ending = f".{format.lstrip('.')}"
    detect_files(source, out, detector, parameters, overlay, ending, report, fail, not raw_orientation)
    if failures:
        raise Exit(1)


def read_mask(path: Path, is_upright: bool = True) -> NDArray[np.bool_]:
    """Return (H, W) whether any channel of an image is above zero."""
    levels = read_image(path, is_upright=is_upright)
    return np.asarray(levels.any(axis=2) if levels.ndim == 3 else levels > 0)
