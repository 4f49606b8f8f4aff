"""`peakmark calibrate`: a camera's intrinsics and lens from photographs of a printed board."""

from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Annotated, Any

from peaksim.image_file import read_image
from typer import Argument, Exit, Option

from peakmark.calibration.fit import Calibration, calibrate
from peakmark.calibration.lens import lens_named
from peakmark.calibration.page import advice, parameter_rows, write_calibration_page
from peakmark.calibration.views import BoardView, board_view
from peakmark.cli.command import examples, print_error
from peakmark.cli.options import Out, Quiet, UnusedSeed
from peakmark.cli.sources import FailedFile, expanded, image_count, read_sources
from peakmark.cli.terminal import new_console, print_path, print_table, progress_bar
from peakmark.errors import InputError, one_line
from peakmark.found.found import find
from peakmark.maps.files import load_map
from peakmark.maps.marker_map import MarkerMap
from peakmark.report.results import result_folder, write_json

FILES = {"camera.yaml": "opencv", "camera_info.yaml": "ros", "camchain.yaml": "kalibr", "cameras.txt": "colmap"}
"""The camera in each format that has a model of its lens."""


@examples(
    "peakmark calibrate 'photos/*.jpg' --sheet board/result.json",
    "peakmark calibrate photos --sheet board/result.json --lens fisheye --out out/wide",
)
def calibrate_camera(
    sources: Annotated[
        list[str], Argument(metavar="IMAGES…", help="Photographs of the board: files, folders, films, bags.")
    ],
    sheet: Annotated[str, Option(help="result.json of the board: `peakmark marker board --paper a3`.")],
    lens: Annotated[str, Option(help="pinhole, brown4, brown5, brown8 or fisheye: OpenCV's coefficients.")] = "brown5",
    scale_bar_mm: Annotated[
        float | None, Option(help="What the board's scale bar measures, if the printer changed its size.")
    ] = None,
    out: Out = Path("out/calibration"),
    seed: UnusedSeed = 0,
    quiet: Quiet = False,
) -> None:
    """Calibrate a camera from photographs of a printed board of coded arrays.

    Photographs show the board flat, tilted by 20 to 45° in several directions, and together all of the image. Writes
    camera.yaml (OpenCV), camera_info.yaml (ROS), camchain.yaml (Kalibr), cameras.txt (COLMAP), report.html with
    residuals, coverage and the photographs that were left out and why, and result.json with the covariance. The camera
    is that of the sensor's own pixels, whatever rotation EXIF notes.
    """
    console = new_console(quiet)
    lens_named(lens)
    board = load_map(sheet, scale_bar_mm)
    if not board.arrays:
        raise InputError(f"{sheet}: expected a sheet with arrays, such as `peakmark marker board` prints")
    named = expanded(sources)
    total = image_count(named)
    views, dropped, size = [], [], None
    failed: list[FailedFile] = []
    read = partial(read_image, is_upright=False)
    with progress_bar(console, "find the board", total) as bar:
        for each in read_sources(named, False, failed.append, read):
            here = (each.image.shape[1], each.image.shape[0])
            size = size or here
            view = board_view(each.name, find(each.image, layout=board.layout), board) if here == size else None
            if isinstance(view, BoardView):
                views.append(view)
            else:
                dropped.append((each.name, view or f"is of {here[0]}×{here[1]} px, the first of {size[0]}×{size[1]}"))
            bar.advance()
    dropped += [(one.name, one.reason) for one in failed]
    for name, reason in dropped:
        print_error(f"{name}: left out: {reason}")
    assert size is not None
    calibration = calibrate(views, size, lens)
    _write(calibration, lens, out, dropped, board)
    _print(console, calibration, lens)
    print_path(console, out / "report.html")
    if failed:
        raise Exit(1)


def _write(calibration: Calibration, lens: str, out: Path, dropped: list[tuple[str, str]], board: MarkerMap) -> None:
    all_dropped = [*dropped, *calibration.dropped]
    with result_folder(out) as folder:
        written = []
        for name, format in FILES.items():
            with suppress(InputError):  # Kalibr and COLMAP have no model of every lens
                calibration.camera.save(folder / name, format=format)
                written.append(name)
        write_json(folder / "result.json", _result(calibration, lens, all_dropped, board))
        write_calibration_page(folder / "report.html", calibration, lens, [*written, "result.json"])


def _result(calibration: Calibration, lens: str, dropped: list[tuple[str, str]], board: MarkerMap) -> dict[str, Any]:
    return {
        "lens": lens,
        "parameters": {name: {"value": v, "sigma": s} for name, v, s in parameter_rows(calibration)},
        "covariance": calibration.covariance,
        "rms_px": calibration.rms_px,
        "sigma_factor": calibration.sigma_factor,
        "board_markers": len(board),
        "markers_left_out": calibration.markers_dropped,
        "photographs": [
            {
                "name": fit.view.name,
                "markers": len(fit.view.xy),
                "rms_px": fit.rms_px,
                "board_from_camera": fit.world_from_camera,
            }
            for fit in calibration.views
        ],
        "left_out": [{"name": name, "reason": reason} for name, reason in dropped],
    }


def _print(console: Any, calibration: Calibration, lens: str) -> None:
    rows = [(name, f"{value:.6g}", f"±{sigma:.2g}") for name, value, sigma in parameter_rows(calibration)]
    count, markers = len(calibration.views), sum(len(fit.view.xy) for fit in calibration.views)
    title = f"{lens} · {count} photographs, {markers} markers · {calibration.rms_px:.3f} px rms"
    print_table(console, title, ("parameter", "value", "σ"), rows)
    for name, reason in calibration.dropped:
        console.print(f"{one_line(name)}: left out: {reason}", soft_wrap=True, highlight=False)
    for sentence in advice(calibration):
        console.print(f"note: {sentence}", soft_wrap=True, highlight=False)
