"""The command line: `peakmark COMMAND …`. A command's module is imported when that command is called."""

from importlib import import_module
from typing import Annotated, Any, NoReturn

from typer import Exit, Option, Typer
from typer.core import TyperGroup
from typer.main import get_command, get_group

from peakmark.cli.command import plain_app, run_command
from peakmark.version import __version__

COMMANDS = {
    "marker": ("peakmark.cli.marker:marker", "Write a print-ready sheet of markers."),
    "identify": (
        "peakmark.cli.identify:identify",
        "Find markers and arrays in images, folders, films, bags, or a camera's images.",
    ),
    "calibrate": (
        "peakmark.cli.calibrate:calibrate_camera",
        "Calibrate a camera from photographs of a printed board of coded arrays.",
    ),
    "map": (
        "peakmark.cli.map:map_arrays",
        "Map where arrays hang, from photographs that show two or more of them at once.",
    ),
    "envelope": (
        "peakmark.cli.envelope:envelope",
        "Say at which distances and tilts a camera finds a marker of a printed size, from measured detection rates.",
    ),
    "detect": ("peakmark.cli.detect:detect", "Detect and describe key points in images, folders and films."),
    "render": ("peakmark.cli.render:render", "Render the images of a scene, with exact truth."),
    "floor": (
        "peakmark.cli.floor:render_floor",
        "Redo the paper's robot experiment: a lab floor with 14 markers, found with SURF, scored against truth.",
    ),
    "fly": (
        "peakmark.cli.floor:fly",
        "Fly a camera over a floor of markers: find them, and locate the camera by them.",
    ),
    "drive": (
        "peakmark.cli.floor:drive_floor",
        "Let a robot drive along random lines of floor markers by nothing but what its camera sees of them.",
    ),
    "cave": (
        "peakmark.cli.cave:render_cave",
        "Redo the paper's SIFT/SURF CAVE: render a room of posters, read its 3-bit marker arrays, score against truth.",
    ),
    "detectability": (
        "peakmark.cli.detectability:detectability",
        "Redo the experiments of Section 4.1 with intervals: scale, rotation, tilt, noise, blur, compression, light.",
    ),
    "compare": (
        "peakmark.cli.compare:compare_designs",
        "Compare markers and arrays with AprilTag, ArUco, rings and corners of one printed area, in the same frames.",
    ),
    "corpus": ("peakmark.cli.corpus:app", "Annotated image sets of any size, rendered with exact truth."),
    "regress": ("peakmark.cli.regress:app", "A detector's figures on rendered fly-throughs, beside accepted ones."),
}
"""Name → module and function or app in it, and the words for the list of commands."""


class LazyGroup(TyperGroup):
    """A group whose commands are imported when they are called, so that `peakmark --help` imports none of them."""

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """Return the called command instead of the entry that stands for it in the list."""
        name, entry, rest = super().resolve_command(ctx, args)
        return name, entry and load_command(str(name)), rest


def load_command(name: str) -> Any:
    """Import a command, or a group of them, in the form that typer calls."""
    module, _, attribute = COMMANDS[name][0].partition(":")
    target = getattr(import_module(module), attribute)
    if isinstance(target, Typer):
        return get_group(target)
    alone = plain_app()
    alone.command(name)(target)
    return get_command(alone)


app = plain_app(
    cls=LazyGroup, add_completion=True, no_args_is_help=True, help="Markers that SIFT and SURF cannot miss."
)


def _print_version(wanted: bool) -> None:
    if wanted:
        print(f"peakmark {__version__}")
        raise Exit


@app.callback()
def _options(
    version: Annotated[
        bool, Option("--version", is_eager=True, callback=_print_version, help="Print the version and exit.")
    ] = False,
) -> None:
    """Markers that SIFT and SURF cannot miss."""


for _name, (_, _words) in COMMANDS.items():
    app.command(_name, help=_words, short_help=_words)(lambda: None)


def main() -> NoReturn:
    """Entry point of `peakmark`."""
    run_command(app)
