"""`peakmark render`: a scene's images with their truth."""

from pathlib import Path
from typing import Annotated

from typer import Argument, Option

from peakmark.cli.command import examples
from peakmark.cli.options import Bake, NoiseSeed, Out, Quiet, Samples, SensorName, drawn_by
from peakmark.cli.terminal import new_console, print_path, progress_bar
from peakmark.experiments.scene_images import SceneImagesConfig, write_scene_images


@examples("peakmark render cave --out out/cave", "peakmark render my_scene.toml --frames 30 --sensor phone")
def render(
    scene: Annotated[str, Argument(help="Scene file, or the name of a shipped scene: floor, hall, cave.")],
    out: Out = Path("out/render"),
    renderer: Annotated[str, Option(help="exact (no OpenGL), gl, pyrender, traced (Mitsuba) or auto.")] = "auto",
    samples: Samples = SceneImagesConfig.samples,
    sensor: SensorName = None,
    bake: Bake = True,
    seed: NoiseSeed = 0,
    frames: Annotated[int, Option(help="Images in even steps of the scene's trajectory.")] = 1,
    quiet: Quiet = False,
) -> None:
    """Render the images of a scene, with exact truth.

    Writes 000000.png and so on, truth.jsonl (where each marker is, a line an image), camera.yaml (OpenCV's
    calibration), poses.tum and result.json, to be compared with what `peakmark identify --map SCENE` finds.
    """
    console = new_console(quiet)
    config = SceneImagesConfig(scene, frames, **drawn_by(renderer, samples, sensor, bake, seed))
    with progress_bar(console, "render", frames) as bar:
        records = write_scene_images(config, out, bar.advance)
    console.print(f"{len(records)} images by {records[0]['renderer']}")
    print_path(console, out)
