"""`peakmark map`: where arrays hang, from photographs of them."""

from functools import partial
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from peaksim.camera.camera import Camera
from peaksim.image_file import read_image
from typer import Argument, Exit, Option

from peakmark.cli.command import examples, print_error
from peakmark.cli.options import Out, Quiet, UnusedSeed
from peakmark.cli.sources import FailedFile, expanded, image_count, read_sources
from peakmark.cli.terminal import new_console, print_path, print_table, progress_bar
from peakmark.errors import InputError
from peakmark.found.found import Found, find
from peakmark.mapping.adjust import BuiltMap, build_map
from peakmark.mapping.sightings import sightings_of
from peakmark.maps.files import load_map, save_map
from peakmark.report.results import result_folder, write_json


@examples(
    "peakmark map 'photos/*.jpg' --calibration cam.yaml --sheet sheet/result.json",
    "peakmark map photos --calibration cam.yaml --sheet board/result.json --out out/room",
)
def map_arrays(
    sources: Annotated[
        list[str], Argument(metavar="IMAGES…", help="Photographs of the arrays: files, folders, films, bags.")
    ],
    calibration: Annotated[str, Option(help="The camera: a file of OpenCV, ROS, Kalibr (FILE#cam0) or COLMAP.")],
    sheet: Annotated[str, Option(help="result.json of the sheet that the arrays were cut from.")],
    scale_bar_mm: Annotated[
        float | None, Option(help="What the sheet's scale bar measures, if the printer changed its size.")
    ] = None,
    out: Out = Path("out/map"),
    seed: UnusedSeed = 0,
    quiet: Quiet = False,
) -> None:
    """Map where arrays hang, from photographs that show two or more of them at once.

    Each code hangs once. Writes map.toml, which `peakmark identify --map` takes, with the σ of each array's position,
    and result.json. The world is the frame of the array that is seen most often: x right, y up the print, z out of it.
    """
    console = new_console(quiet)
    camera = Camera.load(calibration)
    printed = load_map(sheet, scale_bar_mm)
    sides = np.unique(printed.sides_m)
    if not printed.arrays or len(sides) != 1:
        raise InputError(f"{sheet}: expected a sheet of arrays of one size, got {len(printed.arrays)} arrays")
    names, photographs, failed = _read(console, expanded(sources), camera, printed.layout)
    sightings, twice = sightings_of(photographs, camera, printed.layout, float(sides[0]))
    for code in twice:
        print_error(f"array {code}: left out: one photograph shows it twice")
    built = build_map(sightings, camera, printed.layout, float(sides[0]))
    with result_folder(out) as folder:
        save_map(built.marker_map, folder / "map.toml")
        write_json(folder / "result.json", _result(built, names, twice))
    title = f"{len(built.marker_map.arrays)} arrays from {len(built.world_from_camera)} photographs"
    print_table(console, f"{title} · {built.rms_px:.3f} px rms", ("array", "x m", "y m", "z m", "± mm"), _rows(built))
    for code in built.unconnected:
        print_error(f"array {code}: left out: no photograph shows it together with the others")
    print_path(console, out / "map.toml", "Map")
    if failed:
        raise Exit(1)


def _read(console: Any, named: list[str], camera: Camera, layout: Any) -> tuple[list[str], list[Found], bool]:
    """Return names and content of the photographs, and whether any was left out."""
    failures: list[FailedFile] = []

    def fail(one: FailedFile) -> None:
        failures.append(one)
        print_error(one.reason)

    total = image_count(named)
    names, photographs = [], []
    with progress_bar(console, "find arrays", total) as bar:
        for each in read_sources(named, False, fail, partial(read_image, is_upright=False)):
            here = (each.image.shape[1], each.image.shape[0])
            if here != (camera.width, camera.height):
                expected = f"expected {camera.width}×{camera.height} px, the calibration's size"
                fail(FailedFile(each.name, f"{each.file}: left out: {expected}, got {here[0]}×{here[1]}"))
                continue
            names.append(each.name)
            photographs.append(find(each.image, layout=layout, focal_px=camera.focal_px))
            bar.advance()
    return names, photographs, bool(failures)


def _rows(built: BuiltMap) -> list[tuple[str, str, str, str, str]]:
    """Return the middle of each array's markers, and how sure that is."""
    rows = []
    assert built.marker_map.sigma_m is not None
    for array in sorted(built.marker_map.arrays, key=lambda each: each.code):
        middle = built.marker_map.centers_m[list(array.rows)].mean(axis=0)
        sigma_mm = 1000 * float(np.sqrt((built.marker_map.sigma_m[list(array.rows)] ** 2).sum(axis=1).mean()))
        x, y, z = (f"{value:.4f}" for value in middle)
        rows.append((str(array.code), x, y, z, f"{sigma_mm:.2g}"))
    return rows


def _result(built: BuiltMap, names: list[str], twice: list[int]) -> dict[str, Any]:
    return {
        "origin": built.origin,
        "arrays": [array.code for array in built.marker_map.arrays],
        "rms_px": built.rms_px,
        "sightings": built.sightings,
        "left_out": [{"photograph": names[s.image], "code": s.code} for s in built.left_out],
        "unconnected": list(built.unconnected),
        "twice_in_one_photograph": twice,
        "photographs": [{"name": names[n], "world_from_camera": pose} for n, pose in built.world_from_camera.items()],
    }
