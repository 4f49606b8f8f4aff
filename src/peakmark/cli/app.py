"""The command line: `peakmark COMMAND …`. Commands import what they need when they run."""

from pathlib import Path
from typing import Annotated, Any, NoReturn

from peaksim.image_file import read_image
from typer import Argument, Option, Typer

from peakmark.cli import corpus as cli_corpus
from peakmark.cli import regress as cli_regress
from peakmark.cli.command import run_command
from peakmark.cli.detect_files import Found, detect_files
from peakmark.cli.envelope import envelope
from peakmark.cli.marker import marker

app = Typer(add_completion=False, no_args_is_help=True, help="Markers that SIFT and SURF cannot miss.")


app.command()(marker)
app.add_typer(cli_corpus.app, name="corpus")
app.add_typer(cli_regress.app, name="regress")
app.command()(envelope)


@app.command()
def detect(
    source: Annotated[Path, Argument(help="A picture (PNG, JPEG, TIFF, …), a folder of pictures, or a film.")],
    out: Annotated[Path, Option(help="Folder, or for one picture FILE.npz, .csv or .json.")] = Path("out/detect"),
    detector: Annotated[str, Option(help="surf, surf-paper, sift, cv2:ORB, module:function, … (see README).")] = "surf",
    threshold: Annotated[float | None, Option(help="Smallest response. [default: 100 for SURF]")] = None,
    octaves: Annotated[int | None, Option(help="Octaves. [default: 4]")] = None,
    layers: Annotated[int | None, Option(help="Searched layers an octave. [default: 3]")] = None,
    extended: Annotated[bool, Option("--extended", help="Descriptors of 128 entries.")] = False,
    upright: Annotated[bool, Option("--upright", help="Do not measure the orientation.")] = False,
    strongest: Annotated[int | None, Option(help="Keep only so many key points.")] = None,
    mask: Annotated[Path | None, Option(help="Picture, nonzero where key points may be.")] = None,
    overlay: Annotated[bool, Option("--overlay", help="Also draw the key points, into NAME.overlay.png.")] = False,
    format: Annotated[str, Option(help="Of the files in a folder: npz, csv or json.")] = "npz",
    seed: Annotated[int, Option(help="Taken by every command; nothing here is random.")] = 0,
    quiet: Annotated[bool, Option("--quiet", help="Print nothing but errors.")] = False,
) -> None:
    """Detect and describe key points in pictures, folders and films."""

    def report(found: Found) -> None:
        if not quiet:
            print(f"{found.name}: {found.keypoints} key points in {found.width}×{found.height} px → {found.file}")

    given = {"threshold": threshold, "octaves": octaves, "layers": layers, "strongest": strongest}
    parameters: dict[str, Any] = {name: value for name, value in given.items() if value is not None}
    parameters |= {name: True for name, value in (("extended", extended), ("upright", upright)) if value}
    if mask is not None:
        parameters["mask"] = _read_mask(mask)
    detect_files(source, out, detector, parameters, overlay, f".{format.lstrip('.')}", report)


def _read_mask(path: Path) -> Any:
    levels = read_image(path)
    return levels.any(axis=2) if levels.ndim == 3 else levels > 0


def main() -> NoReturn:
    """Entry point of `peakmark`."""
    run_command(app)


if __name__ == "__main__":
    main()
