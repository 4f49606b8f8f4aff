"""`peakmark calibrate`: a camera's intrinsics and lens from photographs of a printed board."""

from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from typing import Annotated, Any

from numpy.typing import NDArray
from peaksim.image_file import read_image
from typer import Argument, Exit, Option

from peakmark.calibration.fit import Calibration, calibrate
from peakmark.calibration.guided import guided_view
from peakmark.calibration.lens import lens_named
from peakmark.calibration.page import advice, parameter_rows, write_calibration_page
from peakmark.calibration.views import BoardView, board_view
from peakmark.cli.command import examples, print_error, resumable
from peakmark.cli.options import Out, Quiet, UnusedSeed
from peakmark.cli.sources import FailedFile, OnFailure, expanded, image_count, read_sources
from peakmark.cli.terminal import FIGURES_WITH_INTERVALS, new_console, print_path, print_table, progress_bar
from peakmark.errors import InputError, one_line
from peakmark.experiments.calibration.figures import study_rows
from peakmark.experiments.calibration.run import run_study
from peakmark.experiments.calibration.study import StudyConfig
from peakmark.experiments.journal import Journal
from peakmark.found.found import find
from peakmark.keypoints.image import as_gray
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
    views, dropped, size = [], [], None
    failed: list[FailedFile] = []
    with progress_bar(console, "find the board", image_count(named)) as bar:
        for name, image in _photographs(named, failed.append):
            here = (image.shape[1], image.shape[0])
            size = size or here
            view = board_view(name, find(image, layout=board.layout), board) if here == size else None
            if isinstance(view, BoardView):
                views.append(view)
            else:
                dropped.append((name, view or f"is of {here[0]}×{here[1]} px, the first of {size[0]}×{size[1]}"))
            bar.advance()
    dropped += [(one.name, one.reason) for one in failed]
    for name, reason in dropped:
        print_error(f"{name}: left out: {reason}")
    assert size is not None
    alone = calibrate(views, size, lens)
    with progress_bar(console, "measure all markers", len(alone.views)) as bar:
        guided = _guided(alone, board, named, bar.advance)
    calibration = calibrate(guided, size, lens)
    calibration = replace(calibration, dropped=alone.dropped + calibration.dropped)
    _write(calibration, lens, out, dropped, board)
    _print(console, calibration, lens)
    print_path(console, out / "report.html")
    if failed:
        raise Exit(1)


def _photographs(named: list[str], on_failure: OnFailure) -> Iterator[tuple[str, NDArray[Any]]]:
    """Yield the name of each photograph, which no other has, and its pixels as the sensor read them out."""
    names: set[str] = set()
    for each in read_sources(named, False, on_failure, partial(read_image, is_upright=False)):
        name = each.name if each.name not in names else f"{each.file} {len(names)}"
        names.add(name)
        yield name, each.image


def _guided(alone: Calibration, board: MarkerMap, named: list[str], on_view: Callable[[], None]) -> list[BoardView]:
    """Return the views of a calibration, measured again where it expects the board's markers."""
    fits, views = {fit.view.name: fit for fit in alone.views}, []
    for name, image in _photographs(named, lambda failed: None):
        if name in fits:
            fit = fits[name]
            views.append(guided_view(as_gray(image), fit.view, board, alone.camera, fit.world_from_camera))
            on_view()
    return views


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


@examples(
    "python scripts/evaluate_calibration.py --workers 2",
    "python scripts/evaluate_calibration.py --cameras 3 --fisheyes 1 --views 10",
)
def evaluate_calibration(
    out: Out = Path("out/evaluate-calibration"),
    cameras: Annotated[int, Option(help="Simulated cameras.")] = StudyConfig.cameras,
    fisheyes: Annotated[int, Option(help="So many of them are fisheyes.")] = StudyConfig.fisheyes,
    views: Annotated[int, Option(help="Photographs of each board.")] = StudyConfig.views,
    seed: Annotated[int, Option(help="Seed of lenses, poses and noise.")] = StudyConfig.seed,
    workers: Annotated[int, Option(help="Processes.")] = 1,
    quiet: Quiet = False,
) -> None:
    """Measure calibrations of simulated cameras whose truth is known: our board, OpenCV's ChArUco and chessboard.

    All boards are photographed from the same poses and fitted alike. Writes result.json with every camera's errors, and
    whether the stated σ are honest; an interrupted run resumes.
    """
    config = StudyConfig(cameras, fisheyes, views, seed)
    console = new_console(quiet)
    journal = Journal.open(out, asdict(config))
    with resumable(), progress_bar(console, "photograph, calibrate") as bar:
        figures = run_study(config, journal, workers, bar.show)
    rows = study_rows(figures)
    with result_folder(out) as folder:
        write_json(folder / "result.json", {"config": asdict(config), "cameras": figures, "figures": rows})
    print_table(console, f"{cameras} cameras · {views} photographs", FIGURES_WITH_INTERVALS, rows)
    print_path(console, out / "result.json", "Result")
