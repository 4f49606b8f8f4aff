"""`peakmark corpus make|check|show|detect`: arguments, progress, and what the terminal shows."""

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from peaksim.corpus import check_corpus, load_spec, make_corpus
from peaksim.corpus.backends import in_process, on_dask, processes
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from typer import Argument, Exit, Option, Typer

from peakmark.errors import InputError
from peakmark.report.corpus_page import open_page, save_recording, show_frames

if TYPE_CHECKING:
    from peaksim.corpus.backends import Backend
    from rich.console import Console

app = Typer(no_args_is_help=True, help="Annotated image sets of any size, rendered with exact truth.")

Quiet = Annotated[bool, Option("--quiet", help="Print nothing but errors.")]
Workers = Annotated[int | None, Option(help="Processes on this machine. [default: its processors]")]
Dask = Annotated[str | None, Option(help="Dask scheduler to work on, such as tcp://host:8786.")]


@app.command()
def make(
    spec: Annotated[Path, Argument(help="Specification, such as scenes/experiments/corpus_small.toml.")],
    out: Annotated[str, Option(help="Folder, or fsspec URL such as s3://bucket/name.")] = "out/corpus",
    seed: Annotated[int | None, Option(help="Instead of the specification's.")] = None,
    frames: Annotated[int | None, Option(help="Instead of the specification's.")] = None,
    workers: Workers = None,
    dask: Dask = None,
    quiet: Quiet = False,
) -> None:
    """Make a corpus, or finish one that was interrupted: every byte is that of an undisturbed run.

    CORPUS.md says what a specification states and what the corpus holds.
    """
    console = Console(quiet=quiet)
    wanted = load_spec(spec, seed=seed, frames=frames)
    with progress_bar(console, "render", wanted.frames) as advance:
        made = make_corpus(wanted, spec.parent, out, backend_of(workers, dask), advance)
    drawn_by = f"{made.configuration.renderer}{_on(made.configuration.gl_renderer)}"
    console.print(f"{made.frames} frames, {made.rendered} rendered now, seed {wanted.seed}, renderer {drawn_by}")
    console.print(f"Corpus: {out}", soft_wrap=True, markup=False)


def _on(gl_renderer: str | None) -> str:
    return "" if gl_renderer is None else f" on {gl_renderer}"


def backend_of(workers: int | None, dask: str | None) -> "Backend":
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
    count = len(os.sched_getaffinity(0)) if workers is None else workers
    return in_process() if count == 1 else processes(count)


@contextmanager
def progress_bar(console: "Console", title: str, total: int | None) -> "Iterator[Callable[[int], None]]":
    """Show a bar while the block runs; give the function that moves it on."""
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=console, transient=True, disable=console.quiet) as progress:
        task = progress.add_task(title, total=total)
        yield lambda count: progress.advance(task, count)


@app.command()
def check(corpus: Annotated[str, Argument(help="Folder or URL of a finished corpus.")], quiet: Quiet = False) -> None:
    """Verify every file of a corpus; print what is wrong and exit with 1, or say that all is well."""
    console = Console(quiet=quiet)
    checked = 0

    def on_file() -> None:
        nonlocal checked
        checked += 1
        advance(1)

    with progress_bar(console, "check", None) as advance:
        faults = check_corpus(corpus, on_file)
    for fault in faults:
        console.print(fault, markup=False, highlight=False, soft_wrap=True)
    if faults:
        raise Exit(1)
    console.print(f"{checked} files, all as they were written")


@app.command()
def show(
    corpus: Annotated[str, Argument(help="Folder or URL of a finished corpus.")],
    frame: Annotated[list[int] | None, Option(help="Frame to show; may be repeated. [default: 12 even steps]")] = None,
    out: Annotated[Path, Option(help="Folder for the pictures and index.html.")] = Path("out/show"),
    rrd: Annotated[Path | None, Option(help="Also write a Rerun recording of those frames.")] = None,
    view: Annotated[bool, Option("--open", help="Open the page in a browser.")] = False,
    quiet: Quiet = False,
) -> None:
    """Draw frames with their markers into a folder with a page to look through."""
    page = show_frames(corpus, frame or None, out)
    if rrd is not None:
        save_recording(corpus, frame or None, rrd)
    Console(quiet=quiet).print(f"Pictures: {page}", soft_wrap=True, markup=False)
    if view:
        open_page(page)
