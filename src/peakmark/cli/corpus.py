"""`peakmark corpus make|check|show`: arguments, progress, and what the terminal shows."""

from pathlib import Path
from typing import Annotated

from peaksim.corpus import check_corpus, load_spec, make_corpus
from peaksim.corpus.backends import Backend, in_process, on_dask, processes
from peaksim.corpus.check import unchecked_inputs
from peaksim.threads import processor_count
from typer import Argument, Exit, Option

from peakmark.cli.command import examples, plain_app, resumable
from peakmark.cli.options import Dask, Quiet, Workers
from peakmark.cli.terminal import new_console, print_path, progress_bar
from peakmark.errors import InputError
from peakmark.report.corpus_page import open_page, save_recording, show_frames

app = plain_app(no_args_is_help=True, help="Annotated image sets of any size, rendered with exact truth.")


@app.command()
@examples(
    "peakmark corpus make scenes/experiments/corpus_small.toml --out out/corpus",
    "peakmark corpus make mine.toml --frames 1000 --workers 4 --out s3://bucket/name",
)
def make(
    spec: Annotated[Path, Argument(help="Specification, such as scenes/experiments/corpus_small.toml.")],
    out: Annotated[str, Option(help="Folder, or fsspec URL such as s3://bucket/name.")] = "out/corpus",
    seed: Annotated[int | None, Option(help="Instead of the specification's.")] = None,
    frames: Annotated[int | None, Option(help="Instead of the specification's.")] = None,
    photographs: Annotated[
        Path | None,
        Option(
            help="Folder of images to warp sheets into, for a specification with [warped]. [default: scikit-image's]"
        ),
    ] = None,
    workers: Workers = None,
    dask: Dask = None,
    quiet: Quiet = False,
) -> None:
    """Make a corpus, or finish one that was interrupted: every byte is that of an undisturbed run.

    CORPUS.md says what a specification states and what the corpus holds.
    """
    console = new_console(quiet)
    wanted = load_spec(spec, seed=seed, frames=frames, photographs=photographs)
    title, total = "render", wanted.frames
    with resumable(), progress_bar(console, title, total) as bar:
        made = make_corpus(wanted, spec.parent, out, backend_of(workers, dask), bar.advance)
    for line in made.damaged:
        console.print(f"made again: {line}", highlight=False, soft_wrap=True)
    gl_renderer = made.configuration.gl_renderer
    drawn_by = made.configuration.renderer + ("" if gl_renderer is None else f" on {gl_renderer}")
    console.print(f"{made.frames} frames, {made.rendered} rendered now, seed {wanted.seed}, renderer {drawn_by}")
    print_path(console, out, "Corpus")


def backend_of(workers: int | None, dask: str | None) -> Backend:
    """Return where tasks run: on a Dask scheduler, in so many processes, or in as many as there are processors.

    Raises
    ------
    InputError
        If both are given.
    """
    if dask is not None:
        if workers is not None:
            raise InputError(f"--workers {workers}: expected --workers or --dask, not both: the scheduler has its own")
        return on_dask(dask)
    count = processor_count() if workers is None else workers
    return in_process() if count == 1 else processes(count)


@app.command()
@examples("peakmark corpus check out/corpus", "peakmark corpus check s3://bucket/name")
def check(
    corpus: Annotated[str, Argument(help="Folder or URL of a finished corpus.")],
    inputs: Annotated[
        Path | None, Option(help="Folder of the specification, to compare its files with the hashes in corpus.json.")
    ] = None,
    quiet: Quiet = False,
) -> None:
    """Verify every file of a corpus; print what is wrong and exit with 1, or say that all is well."""
    console = new_console(quiet)
    with progress_bar(console, "check") as bar:
        faults = check_corpus(corpus, bar.advance, inputs)
        checked = bar.done
    for fault in faults:
        console.print(fault, highlight=False, soft_wrap=True)
    if faults:
        raise Exit(1)
    console.print(f"{checked} files, all as they were written")
    if names := unchecked_inputs(corpus, inputs):
        text = f"Input files that are not here, and were not compared: {', '.join(map(repr, names))} (see --inputs)"
        console.print(text, highlight=False, soft_wrap=True)


@app.command()
@examples("peakmark corpus show out/corpus", "peakmark corpus show out/corpus --frame 3 --frame 7 --open")
def show(
    corpus: Annotated[str, Argument(help="Folder or URL of a finished corpus.")],
    frame: Annotated[list[int] | None, Option(help="Frame to show; may be repeated. [default: 12 even steps]")] = None,
    out: Annotated[Path, Option(help="Folder for the images and index.html.")] = Path("out/show"),
    rrd: Annotated[Path | None, Option(help="Also write a Rerun recording of those frames.")] = None,
    view: Annotated[bool, Option("--open", help="Open the page in a browser.")] = False,
    quiet: Quiet = False,
) -> None:
    """Draw frames with their markers into a folder, with a page that shows them all."""
    page = show_frames(corpus, frame or None, out)
    if rrd is not None:
        save_recording(corpus, frame or None, rrd)
    print_path(new_console(quiet), page, "Images")
    if view:
        open_page(page)
