"""`peakmark regress run|accept|compare`: a detector's CI on rendered fly-throughs."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from rich.console import Console
from rich.markup import escape
from rich.table import Table
from typer import Argument, Exit, Option, Typer

from peakmark.cli.corpus import Dask, Quiet, Workers, backend_of, progress_bar
from peakmark.errors import InputError
from peakmark.regress.compare import compare as compare_records
from peakmark.regress.metrics import metrics_of, resample_counts
from peakmark.regress.outputs import SIGNS, change_text, junit_xml, markdown, number, plain, tolerance_text
from peakmark.regress.page import colour_of, write_page
from peakmark.regress.record import read_record, to_text
from peakmark.regress.run import run_suite
from peakmark.regress.suite import load_suite
from peakmark.report.results import result_folder, write_json

if TYPE_CHECKING:
    from rich.table import Table

    from peakmark.regress.compare import Comparison
    from peakmark.regress.run import Run

app = Typer(no_args_is_help=True, help="A detector's figures on rendered fly-throughs, beside accepted ones.")

_DETECTORS = "markers, cave-markers, aruco, apriltag, surf, sift, cv2:NAME, module:function or 'exec:PROGRAM …'"

RUN = "run.json"
PICTURES = "pictures"

Baseline = Annotated[Path, Option(help="The accepted figures: one file, made to be committed and to be read in diffs.")]
RunFolder = Annotated[Path, Argument(help="Folder that `peakmark regress run` wrote.")]


@app.command()
def run(
    suite: Annotated[str, Argument(help="floor, cave, a TOML file, or a finished corpus.")] = "floor",
    out: Annotated[Path, Option(help="Folder for the results; made if missing.")] = Path("out/regress"),
    detector: Annotated[str | None, Option(help=f"{_DETECTORS}. [default: the suite's]")] = None,
    stretch: Annotated[float | None, Option(help="Vertical stretch of markers. [default: the suite's]")] = None,
    threshold: Annotated[float | None, Option(help="Smallest response. [default: the detector's]")] = None,
    octaves: Annotated[int | None, Option(help="Octaves. [default: the detector's]")] = None,
    layers: Annotated[int | None, Option(help="Searched layers an octave. [default: the detector's]")] = None,
    time_limit: Annotated[float, Option(help="Seconds for one frame, of a detector in its own process.")] = 10.0,
    quick: Annotated[bool, Option("--quick", help="Fewer frames, in even steps.")] = False,
    seed: Annotated[int | None, Option(help="Of the sensor noise; views stay. [default: the suite's]")] = None,
    workers: Workers = None,
    dask: Dask = None,
    quiet: Quiet = False,
) -> None:
    """Render a suite's frames (or read a corpus's), run the detector, score it, and write run.json and pictures."""
    console = Console(quiet=quiet)
    opened = load_suite(suite)
    given = {"threshold": threshold, "octaves": octaves, "layers": layers}
    parameters = {name: value for name, value in given.items() if value is not None}
    finder = opened.finder(name=detector, stretch=stretch, parameters=parameters, time_limit_s=time_limit)
    with result_folder(out) as folder, progress_bar(console, "run", len(opened.frames(quick))) as advance:
        (folder / PICTURES).mkdir()
        done = run_suite(
            opened,
            finder,
            quick=quick,
            seed=seed,
            backend=backend_of(workers, dask),
            pictures=folder / PICTURES,
            on_frames=advance,
        )
        (folder / RUN).write_text(to_text(done.record), encoding="utf-8")
        write_json(
            folder / "result.json",
            {
                "suite": done.record.suite,
                "frames": len(done.record.results),
                "time_s": {"render": done.render_s, "detect": done.find_s},
            },
        )
    console.print(_run_table(done))
    console.print(f"Results: {out / RUN}", soft_wrap=True, markup=False)


def _run_table(done: "Run") -> "Table":

    record = done.record
    detector = escape(str(record.detector["name"]))
    table = Table(
        "figure",
        "value",
        "95 % interval",
        "unit",
        title=f"{record.suite} · {detector} · {len(record.results)} frames · seed {record.seed}",
    )
    counts = resample_counts(len(record.results))
    for metric in metrics_of(record.results, record.tolerances):
        interval = metric.interval(counts)
        between = "–" if interval is None else f"{number(interval[0])} … {number(interval[1])}"
        table.add_row(metric.key, number(metric.value()), between, metric.unit)
    table.add_row("time to render or read", number(done.render_s), "", "s a frame")
    table.add_row("time to detect", number(done.find_s), "", "s a frame")
    return table


@app.command()
def accept(folder: RunFolder, baseline: Baseline, quiet: Quiet = False) -> None:
    """Make a run's figures the baseline that later runs are compared with."""
    write_whole(baseline, to_text(read_record(folder / RUN)))
    Console(quiet=quiet).print(f"Baseline: {baseline}", soft_wrap=True, markup=False)


def write_whole(path: Path, text: str) -> None:
    """Write a file so that it is there whole or as it was.

    Raises
    ------
    InputError
        If it cannot be written.
    """
    unfinished = path.with_name(f".{path.name}.unfinished")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        unfinished.write_text(text, encoding="utf-8")
        unfinished.replace(path)
    except OSError as error:
        unfinished.unlink(missing_ok=True)
        raise InputError(f"{path}: cannot be written: {error.strerror or error}") from error


@app.command()
def compare(
    folder: RunFolder,
    baseline: Baseline,
    out: Annotated[Path, Option(help="Folder for report.html, summary.md, junit.xml and result.json.")] = Path(
        "out/compare"
    ),
    quiet: Quiet = False,
) -> None:
    """Compare a run with the baseline, frame by frame; exit with 1 if anything got worse or changed."""
    console = Console(quiet=quiet)
    comparison = compare_records(read_record(folder / RUN), read_record(baseline))
    with result_folder(out) as stage:
        write_page(stage / "report.html", comparison, folder / PICTURES)
        (stage / "summary.md").write_text(markdown(comparison), encoding="utf-8")
        (stage / "junit.xml").write_bytes(junit_xml(comparison))
        write_json(stage / "result.json", plain(comparison))
    console.print(_comparison_table(comparison))
    console.print(f"Results: {out / 'report.html'}", soft_wrap=True, markup=False)
    if comparison.faults:
        raise Exit(1)


def _comparison_table(comparison: "Comparison") -> "Table":

    faults = len(comparison.faults)
    table = Table(
        "",
        "figure",
        "before",
        "after",
        "change",
        "tolerance",
        title=f"{comparison.after.suite}: {faults} worse or changed"
        if faults
        else f"{comparison.after.suite}: no regression",
    )
    for change in comparison.changes:
        amount = change_text(change).replace("[", r"\[")
        table.add_row(
            SIGNS[change.verdict],
            change.metric.key,
            number(change.before),
            number(change.after),
            amount,
            tolerance_text(change),
            style=colour_of(change),
        )
    return table
