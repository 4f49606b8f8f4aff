"""The commands that train the decision of `identify(image)` and measure how far it reaches."""

from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any, cast

from typer import Option

from peakmark.cli.command import examples, resumable
from peakmark.cli.options import Out, Quiet
from peakmark.cli.terminal import FIGURES, new_console, print_path, print_table, progress_bar
from peakmark.experiments.journal import Journal
from peakmark.experiments.search import kinds, screening
from peakmark.experiments.search.centers import CentersConfig, measure_centers
from peakmark.experiments.search.kinds import KindsConfig
from peakmark.experiments.search.places import Place
from peakmark.experiments.search.sweeps import SweepConfig, run_sweeps
from peakmark.experiments.search.training import SearchTrainingConfig, collect_evidence, result_rows, train, write_model
from peakmark.identification.families import FAMILIES
from peakmark.markers.optimum import Limit
from peakmark.markers.patterns import Made
from peakmark.report.results import result_folder, write_json


@examples(
    "python scripts/train_search.py --workers 2",
    "python scripts/train_search.py --detector sift --images 24 --empty 12 --out out/quick",
)
def train_search(
    out: Out = Path("out/search"),
    images: Annotated[int, Option(help="Random images with markers.")] = SearchTrainingConfig.images,
    empty: Annotated[int, Option(help="Images without any.")] = SearchTrainingConfig.empty,
    seed: Annotated[int, Option(help="Seed of the images.")] = SearchTrainingConfig.seed,
    detector: Annotated[str, Option(help="surf or sift: that the markers are made for.")] = "surf",
    workers: Annotated[int, Option(help="Processes.")] = 1,
    quiet: Quiet = False,
) -> None:
    """Train the decision of identify(image): what is a marker, from alignments in random light and photographs.

    Writes general.json or sift.json (which ship in peakmark.identification), and result.json. An interrupted run
    resumes.
    """
    config = SearchTrainingConfig(images, empty, seed, cast(Made, detector))
    console = new_console(quiet)
    journal = Journal.open(out, asdict(config))
    with resumable(), progress_bar(console, "render, align") as bar:
        evidence = collect_evidence(config, journal, workers, bar.show)
    model = train(evidence, config)
    write_model(out, model)
    print_table(console, f"{images} + {empty} images · seed {seed}", FIGURES, result_rows(model))
    print_path(console, out / FAMILIES[config.made_for].model, "Model")


@examples("python scripts/train_screen.py --workers 2", "python scripts/train_screen.py --images 24 --out out/quick")
def train_screen(
    out: Out = Path("out/screen"),
    images: Annotated[int, Option(help="Random images with markers.")] = SearchTrainingConfig.images,
    empty: Annotated[int, Option(help="Images without any.")] = SearchTrainingConfig.empty,
    seed: Annotated[int, Option(help="Seed of the images.")] = SearchTrainingConfig.seed,
    workers: Annotated[int, Option(help="Processes.")] = 1,
    quiet: Quiet = False,
) -> None:
    """Train the screen of identify(image): which candidates are worth an alignment.

    Writes screen.json (which ships in peakmark.identification), and result.json. An interrupted run resumes.
    """
    config = SearchTrainingConfig(images, empty, seed)
    console = new_console(quiet)
    journal = Journal.open(out, asdict(config))
    with resumable(), progress_bar(console, "render, align") as bar:
        screened = screening.collect_looks(config, journal, workers, bar.show)
    screen = screening.train(screened, config)
    screening.write_screen(out, screen)
    print_table(console, f"{images} + {empty} images · seed {seed}", FIGURES, screening.result_rows(screen))
    print_path(console, out / "screen.json", "Screen")


@examples(
    "python scripts/evaluate_search.py --workers 2", "python scripts/evaluate_search.py --markers 4 --out out/quick"
)
def evaluate_search(
    out: Out = Path("out/reach"),
    markers: Annotated[int, Option(help="Markers in each cell.")] = SweepConfig.markers,
    seed: Annotated[int, Option(help="Seed of phases, rotations and noise.")] = SweepConfig.seed,
    detector: Annotated[str, Option(help="surf, sift, vlfeat or surf-disc: that looks for its markers.")] = "surf",
    limit: Annotated[str, Option(help="energy or range, the binary pattern: for sift a disc.")] = "energy",
    workers: Annotated[int, Option(help="Processes.")] = 1,
    quiet: Quiet = False,
) -> None:
    """Measure how far identify(image) reaches: noise, light, tone, motion, size and tilt, one at a time.

    Writes result.json, with a 95 % interval each; an interrupted run resumes.
    """
    config = SweepConfig(markers, seed, detector, cast(Limit, limit))
    console = new_console(quiet)
    journal = Journal.open(out, asdict(config))
    with resumable(), progress_bar(console, "draw, identify") as bar:
        rows = run_sweeps(config, journal, workers, bar.show)
    with result_folder(out) as folder:
        write_json(folder / "result.json", {"config": asdict(config), "cells": rows})
    title = f"{markers} markers a cell"
    print_table(console, title, FIGURES, [(_named(row), f"{row['found']} of {row['of']}") for row in rows])
    print_path(console, out / "result.json", "Result")


@examples(
    "python scripts/compare_kinds.py --place floors --place rooms --workers 2",
    "python scripts/compare_kinds.py --frames 4 --out out/quick",
)
def compare_kinds(
    out: Out = Path("out/kinds"),
    frames: Annotated[int, Option(help="Frames of each place.")] = KindsConfig.frames,
    seed: Annotated[int, Option(help="Seed of the frames.")] = KindsConfig.seed,
    place: Annotated[
        list[str] | None, Option(help="sheets, floors or rooms; may be repeated. [default: sheets]")
    ] = None,
    workers: Annotated[int, Option(help="Processes.")] = 1,
    quiet: Quiet = False,
) -> None:
    """Compare SURF's marker, SIFT's and the disc in the same frames of photographs that nothing was trained on.

    Sheets are twelve markers in even light; floors and rooms are random, with arrays, lamps, other cameras and noise.
    Writes result.json, with 95 % intervals; an interrupted run resumes, and one with more frames takes what is there.
    """
    config = KindsConfig(frames, seed, tuple(cast(list[Place], place)) if place else KindsConfig.places)
    console = new_console(quiet)
    journal = Journal.open(out, {"seed": seed})
    with resumable(), progress_bar(console, "render, identify") as bar:
        rows = kinds.compare_kinds(config, journal, workers, bar.show)
    with result_folder(out) as folder:
        write_json(
            folder / "result.json", {"config": asdict(config), "kinds": rows, "faults": kinds.faults(config, journal)}
        )
    for row in rows:
        title = f"{row['place']}: {row['detector']}, {row['limit']}"
        print_table(console, title, FIGURES, [(key, _shown(value)) for key, value in row.items() if key not in _TITLE])
    print_path(console, out / "result.json", "Result")


@examples(
    "python scripts/evaluate_centers.py --workers 2", "python scripts/evaluate_centers.py --views 1 --out out/quick"
)
def evaluate_centers(
    out: Out = Path("out/centers"),
    views: Annotated[int, Option(help="Of each kind, size and tilt, each with every noise.")] = CentersConfig.views,
    seed: Annotated[int, Option(help="Seed of views, noise and starts.")] = CentersConfig.seed,
    workers: Annotated[int, Option(help="Processes.")] = 1,
    quiet: Quiet = False,
) -> None:
    """Measure how exact centres and sizes of round markers are, and whether their covariance says so.

    Sides of 20…200 px, tilts to 60°, noise to σ 8, with the focal length told and guessed. Writes result.json; an
    interrupted run resumes.
    """
    config = CentersConfig(views, seed)
    console = new_console(quiet)
    journal = Journal.open(out, asdict(config))
    with resumable(), progress_bar(console, "render, refine") as bar:
        rows = measure_centers(config, journal, workers, bar.show)
    with result_folder(out) as folder:
        write_json(folder / "result.json", {"config": asdict(config), "rows": rows})
    for row in rows:
        title = f"{row['kind']}, {row['way']}, noise {row['noise']:g}"
        print_table(console, title, FIGURES, [(key, _shown(value)) for key, value in row.items() if key not in _TITLE])
    print_path(console, out / "result.json", "Result")


_TITLE = ("place", "detector", "limit", "groups", "kind", "way", "noise")


def _shown(value: Any) -> Any:
    """Return an interval as words, everything else as it is."""
    return f"{value[0]:.4f}…{value[1]:.4f}" if isinstance(value, list) else value


def _named(row: dict[str, Any]) -> str:
    return f"{row['disturbance']} {row['value']:g} at {row['tilt_deg']:g}°"
