"""`peakmark regress run|accept|compare`: a detector's CI on rendered fly-throughs."""

from pathlib import Path
from typing import Annotated

from peaksim.whole_file import write_whole
from rich.table import Table
from typer import Argument, Exit, Option

from peakmark.cli.command import examples, plain_app
from peakmark.cli.corpus import backend_of
from peakmark.cli.options import Dask, Out, Quiet, Workers, given
from peakmark.cli.terminal import new_console, print_path, progress_bar
from peakmark.errors import InputError, one_line
from peakmark.regress.compare import Comparison, compare_records
from peakmark.regress.metrics import metrics_of
from peakmark.regress.outputs import cells_of, junit_xml, markdown, number, plain
from peakmark.regress.page import write_page
from peakmark.regress.record import read_record, to_text
from peakmark.regress.run import Run, run_suite
from peakmark.regress.suite import load_suite
from peakmark.report.results import result_folder, write_json
from peakmark.score.statistics import resample_counts

app = plain_app(no_args_is_help=True, help="A detector's figures on rendered fly-throughs, beside accepted ones.")

_COLOURS = {"worse": "red", "changed": "red", "better": "green"}
_DETECTORS = (
    "markers, identify, cave-markers, aruco, apriltag, surf, sift, cv2:NAME, module:function (returns points, "
    "cv2.KeyPoint, Keypoints or Detection), or 'exec:PROGRAM …' (answers in JSON lines); "
    "docs/how-to/use-your-own-detector.md says how"
)

RUN = "run.json"
IMAGES = "pictures"
"""Names in a run's folder."""

Baseline = Annotated[Path, Option(help="The accepted figures: one file, made to be committed and to be read in diffs.")]
RunFolder = Annotated[Path, Argument(help="Folder that `peakmark regress run` wrote.")]
ReportFolder = Annotated[Path, Option(help="Folder for report.html, summary.md, junit.xml and result.json.")]


@app.command("run")
@examples(
    "peakmark regress run floor --quick --out out/regress",
    "peakmark regress run cave --detector mymodule:detect --workers 2",
)
def run_detector(
    suite: Annotated[str, Argument(help="floor, cave, a TOML file, or a finished corpus.")] = "floor",
    out: Out = Path("out/regress"),
    detector: Annotated[str | None, Option(help=f"{_DETECTORS}. [default: the suite's]")] = None,
    stretch: Annotated[float | None, Option(help="Vertical stretch of markers. [default: the suite's]")] = None,
    threshold: Annotated[float | None, Option(help="Smallest response. [default: the detector's]")] = None,
    octaves: Annotated[int | None, Option(help="Octaves. [default: the detector's]")] = None,
    layers: Annotated[int | None, Option(help="Searched layers an octave. [default: the detector's]")] = None,
    time_limit: Annotated[float, Option(help="Seconds for one frame, of a detector in its own process.")] = 10.0,
    start_limit: Annotated[float, Option(help="Seconds for its start, and once more for its first frame.")] = 60.0,
    quick: Annotated[bool, Option("--quick", help="Fewer frames, in even steps.")] = False,
    seed: Annotated[int | None, Option(help="Of the sensor noise; views stay. [default: the suite's]")] = None,
    workers: Workers = None,
    dask: Dask = None,
    quiet: Quiet = False,
) -> None:
    """Render a suite's frames (or read a corpus's), run the detector, score it, and write run.json and images."""
    console = new_console(quiet)
    opened = load_suite(suite)
    parameters = given(threshold=threshold, octaves=octaves, layers=layers)
    limits = {"time_limit_s": time_limit, "start_limit_s": start_limit}
    settings = opened.detector(name=detector, stretch=stretch, parameters=parameters, **limits)
    if stretch is not None and settings.name != "markers":
        raise InputError(f"--stretch {stretch:g}: expected none for detector {settings.name}, only markers takes one")
    with result_folder(out) as folder, progress_bar(console, "run", len(opened.frames(quick))) as bar:
        (folder / IMAGES).mkdir()
        backend = backend_of(workers, dask)
        done = run_suite(opened, settings, quick, seed, backend, images=folder / IMAGES, on_frames=bar.advance)
        (folder / RUN).write_text(to_text(done.record), encoding="utf-8")
        times = {"render": done.render_s, "detect": done.detect_s}
        result = {"suite": done.record.suite, "frames": len(done.record.results), "time_s": times}
        write_json(folder / "result.json", result)
    console.print(_run_table(done))
    print_path(console, out / RUN)


def _run_table(done: Run) -> Table:
    record = done.record
    title = f"{record.suite} · {record.detector.name} · {len(record.results)} frames · seed {record.seed}"
    table = Table("figure", "value", "95 % interval", "unit", title=one_line(title))
    counts = resample_counts(len(record.results))
    for metric in metrics_of(record.results, record.tolerances):
        interval = metric.interval(counts)
        between = "–" if interval is None else f"{number(interval[0])} … {number(interval[1])}"
        table.add_row(metric.key, number(metric.value()), between, metric.unit)
    table.add_row("time to render or read", number(done.render_s), "", "s a frame")
    table.add_row("time to detect", number(done.detect_s), "", "s a frame")
    return table


@app.command("accept")
@examples(
    "peakmark regress accept out/regress --baseline baseline.json",
    "peakmark regress accept out/nightly --baseline baselines/floor.json",
)
def accept_run(folder: RunFolder, baseline: Baseline, quiet: Quiet = False) -> None:
    """Make a run's figures the baseline that later runs are compared with."""
    text = to_text(read_record(folder / RUN))
    try:
        baseline.parent.mkdir(parents=True, exist_ok=True)
        write_whole(baseline, text)
    except OSError as error:
        raise InputError(f"{baseline}: cannot be written: {error.strerror or error}") from error
    print_path(new_console(quiet), baseline, "Baseline")


@app.command("compare")
@examples(
    "peakmark regress compare out/regress --baseline baseline.json",
    "peakmark regress compare out/regress --baseline baseline.json --out out/compare --quiet",
)
def compare_run(
    folder: RunFolder, baseline: Baseline, out: ReportFolder = Path("out/compare"), quiet: Quiet = False
) -> None:
    """Compare a run with the baseline, frame by frame; exit with 1 if anything got worse or changed."""
    console = new_console(quiet)
    comparison = compare_records(read_record(folder / RUN), read_record(baseline))
    with result_folder(out) as stage:
        write_page(stage / "report.html", comparison, folder / IMAGES)
        (stage / "summary.md").write_text(markdown(comparison), encoding="utf-8")
        (stage / "junit.xml").write_bytes(junit_xml(comparison))
        write_json(stage / "result.json", plain(comparison))
    console.print(_comparison_table(comparison))
    print_path(console, out / "report.html")
    if comparison.faults:
        raise Exit(1)


def _comparison_table(comparison: Comparison) -> Table:
    faults, suite = len(comparison.faults), one_line(comparison.after.suite)
    table = Table(
        *("", "figure", "before", "after", "change", "tolerance"),
        title=f"{suite}: {faults} worse or changed" if faults else f"{suite}: no regression",
    )
    for change in comparison.changes:
        table.add_row(*cells_of(change), style=_COLOURS.get(change.verdict))
    return table
